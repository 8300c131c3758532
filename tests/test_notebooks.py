"""The example notebooks run, cell by cell, and lie in the repository without outputs."""

import json
import re
from pathlib import Path

import pytest

FILES = sorted((Path(__file__).parents[1] / "docs" / "notebooks").glob("*.ipynb"))
WHY = "notebooks need nbclient and ipykernel: pip install -e '.[dev]'"


@pytest.mark.parametrize("file", FILES, ids=lambda file: file.stem)
def test_outputs_are_stripped(file):
    cells = json.loads(file.read_text(encoding="utf-8"))["cells"]
    of_code = [cell for cell in cells if cell["cell_type"] == "code"]
    assert of_code
    for cell in of_code:
        assert (cell["outputs"], cell["execution_count"]) == ([], None)


@pytest.mark.nightly
@pytest.mark.filterwarnings("ignore::DeprecationWarning", "ignore::ResourceWarning")
def test_first_rays_runs_and_shows_itself(tmp_path):
    """Every cell without an error; progress is one output, the result a picture with its words."""
    pytest.importorskip("ipykernel", reason=WHY)
    nbclient = pytest.importorskip("nbclient", reason=WHY)
    import nbformat

    (file,) = FILES
    notebook = nbformat.read(file, as_version=4)
    # Beside nothing, as a reader's would be; a first run also compiles kernels.
    resources = {"metadata": {"path": str(tmp_path)}}
    nbclient.NotebookClient(
        notebook, timeout=300, kernel_name="python3", resources=resources
    ).execute()
    (cell,) = (cell for cell in notebook.cells if "progress_bar()" in cell.source)
    bar, result = cell.outputs
    assert bar.data["text/plain"].startswith("Rendering 100 %")
    assert '<progress value="' in bar.data["text/html"]
    one_line = r"RenderResult\(240 x 180, path, 8 passes, \S+ s, error .*\)"
    assert re.fullmatch(one_line, result.data["text/plain"])
    assert {"image/png", "text/html"} <= set(result.data)
    assert not [
        output
        for cell in notebook.cells
        for output in cell.get("outputs", [])
        if output.output_type == "error" or output.get("name") == "stderr"
    ]
