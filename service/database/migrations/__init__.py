"""Steps to the newest schema, one file a version, run by Alembic; a released step is frozen."""
