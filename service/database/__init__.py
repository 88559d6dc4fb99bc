"""The database: access, tables, migrations and pagination, for SQLite and for PostgreSQL."""
