"""The experiments of the paper, one a file, each beside the paper's own figures."""
