"""Networks, action distribution and the sources of the hardware vector v_h."""
