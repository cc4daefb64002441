"""XML files of VTK under the extension of legacy files."""

import pytest

from meshreel.errors import FormatError
from meshreel.formats.load import load
from meshreel.formats.save import save
from samples.meshes import waving_grid


@pytest.mark.parametrize("extension", [".vtp", ".vtu"])
def test_xml_file_called_vtk_is_refused_with_the_extension_that_it_should_have(tmp_path, extension):
    save(waving_grid(1), tmp_path / f"a_%d{extension}")
    path = (tmp_path / f"a_0{extension}").rename(tmp_path / "a.vtk")
    message = (
        rf"a\.vtk: is a VTK XML file of \w+, not a legacy file of VTK; rename it to {extension}"
    )
    with pytest.raises(FormatError, match=message):
        load(path)
    load(path.rename(tmp_path / f"a{extension}"))


@pytest.mark.parametrize(
    ("kind", "remedy"),
    [
        ("Collection", "rename it to .pvd"),
        ("ImageData", "its extension is .vti, which is not read; convert it to .vtp or .vtu"),
        ("Table", "convert it to .vtp or .vtu"),
    ],
)
def test_other_xml_files_of_vtk_are_refused_with_what_to_do(tmp_path, kind, remedy):
    head = f'<?xml version="1.0"?>\n<!-- ours -->\n<VTKFile version="1.0" type="{kind}">\n'
    (tmp_path / "a.vtk").write_text(head)
    with pytest.raises(FormatError) as caught:
        load(tmp_path / "a.vtk")
    assert str(caught.value).endswith(
        f"is a VTK XML file of {kind}, not a legacy file of VTK; {remedy}"
    )


def test_file_of_another_kind_is_refused_as_before(tmp_path):
    (tmp_path / "a.vtk").write_bytes(b"<svg/>")
    with pytest.raises(FormatError, match="does not begin with '# vtk DataFile Version'"):
        load(tmp_path / "a.vtk")
