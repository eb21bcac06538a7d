"""The workflow that runs the tests on other systems."""

import subprocess
import sys
from pathlib import Path

import pytest


@pytest.mark.verify
def test_the_workflow_of_the_code_host_follows_its_schema():
    workflow = Path(__file__).parents[1] / ".github" / "workflows" / "tests.yml"
    command = [sys.executable, "-m", "check_jsonschema", "--builtin-schema", "vendor.github-workflows", str(workflow)]
    subprocess.run(command, check=True)
