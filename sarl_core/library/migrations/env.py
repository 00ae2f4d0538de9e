"""What Alembic executes: the steps, on the connection that a library has open."""

from alembic import context

context.configure(connection=context.config.attributes["connection"])
context.run_migrations()
