"""The report: one HTML page with what the runs measured beside the paper's figures."""
