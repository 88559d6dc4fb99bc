"""What a child process takes from itself before it reads a stranger's file."""
