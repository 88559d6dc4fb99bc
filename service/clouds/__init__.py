"""Clouds that callers have sent: stored clouds, resumable uploads, references from a job."""
