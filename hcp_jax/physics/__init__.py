"""One physics interface, three engines that agree: MJX on Warp, MJX on XLA, native MuJoCo threads."""
