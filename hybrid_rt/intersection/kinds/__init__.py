"""One class for each kind of surface: it builds the tables that its kernels take."""
