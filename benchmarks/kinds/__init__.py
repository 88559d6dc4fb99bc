"""Kinds of trouble in clouds as they come, and how registrations fare."""
