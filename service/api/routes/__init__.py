"""The routes, one router per module."""
