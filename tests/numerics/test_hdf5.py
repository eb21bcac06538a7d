"""Bytes of datasets in memory."""

import pytest

from sim.numerics import hdf5


@pytest.mark.parametrize(
    ("key", "value"),
    # of the comments in lookup3.c
    [(b"", 0xDEADBEEF), (b"Four score and seven years ago", 0x17770551)],
)
def test_the_hash_of_metadata_is_that_of_its_author(key, value):
    assert hdf5.lookup3(key) == value


@pytest.mark.skipif(
    not hdf5.hdf5_gives_bytes(), reason="this build of netCDF4 hides its HDF5"
)
def test_bytes_with_the_checksum_of_an_open_file_are_mended(tmp_path):
    path = tmp_path / "x.nc"
    hdf5.write_in_memory(path, lambda file: file.createDimension("t", 3))
    right = bytearray(path.read_bytes())
    assert right[8] >= 2 and right[11] == 0
    # HDF5 1.14.2 leaves the checksum of the flag of a file that is written
    opened = right[:11] + b"\1" + right[12:44]
    wrong = right[:44] + hdf5.lookup3(opened).to_bytes(4, "little") + right[48:]
    with pytest.raises(OSError, match="HDF"):
        hdf5.File("x.nc", memory=wrong)
    assert hdf5.with_checksum(wrong) == right
    with hdf5.File(path) as file:
        assert len(file.dimensions["t"]) == 3
