"""The steps that bring a job store to the newest schema, one file a version, run by Alembic."""
