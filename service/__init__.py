"""REST service and command line around `mpe_core`."""
