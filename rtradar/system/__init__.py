"""Files, output folders, threads, GPUs and checks of input: what the machine and the user ask for."""
