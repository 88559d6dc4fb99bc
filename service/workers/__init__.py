"""Workers: claim jobs, run each in a sandboxed child process, record the outcome."""
