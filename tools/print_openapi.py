"""Print the OpenAPI description of the service as YAML: what openapi.yaml holds."""

from __future__ import annotations

import sys

import yaml

from service.app import create_app

if __name__ == "__main__":
    description = create_app().openapi()
    yaml.safe_dump(description, sys.stdout, sort_keys=False, allow_unicode=True, width=100)
