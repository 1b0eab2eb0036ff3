"""Attributes of returns in LAS: lossless from file to memory to file; selection of points."""

import laspy
import numpy as np
import numpy.testing as npt
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from trueterrain import formats
from trueterrain.core.errors import CoverageError, FormatError, SchemaError
from trueterrain.core.schemas import make_points
from trueterrain.formats import PointFilter, las
from trueterrain.formats.settings import parse_settings

SAME = {"rtol": 0, "atol": 0}
SAME_PLACE = {"rtol": 0, "atol": 2e-9}  # [m] float64 at 6e6 m has steps of 1e-9 m
RANK = {"rtol": 0, "atol": 0.003 + 1e-6}  # [deg] half a step: 1 deg is no multiple of 0.006 deg
FORMATS = (0, 1, 2, 3, 6, 7, 8)  # of points, without wave packets
STRIPS = [
    "las_with_origin_dsmMarker.laz",
    "las_with_several_extra_byte_bloc.laz",
    "St_Barth_RGAF09_UTM20N_IGN_1988_SB_subset_100m.laz",
    "test_data_77055_627755_LA93_IGN69.laz",
    "test_semis_2021_0382_6565_LA93_IGN69_cropped.laz",
]
PLACE = ("X", "Y", "Z")
EXACT_IN_TEXT = 2**53  # [1] integers up to it are float64, as which text is read


def write_las(path, point_format, *, size=500, largest=2**64):
    """A file by laspy alone, with random values in every dimension."""
    rng = np.random.default_rng(point_format)
    header = laspy.LasHeader(version="1.4", point_format=point_format)
    header.scales, header.offsets = np.full(3, 0.00025), np.array([691000.0, 5.3e6, 0.0])
    plain = ("u1", "i1", "u2", "i2", "u4", "i4", "u8", "i8", "f4", "f8")
    header.add_extra_dims(
        [
            *(laspy.ExtraBytesParams(f"plain {kind}", kind) for kind in plain),
            laspy.ExtraBytesParams("Reflectance", "i2", "dB", scales=[0.01], offsets=[-20.0]),
            laspy.ExtraBytesParams("a direction with a name too long", "3f4"),
            laspy.ExtraBytesParams("sd", "f4"),
        ]
    )
    content = laspy.LasData(header)
    for name in PLACE:
        content[name] = rng.integers(-(10**6), 10**6, size)
    for dimension in header.point_format.dimensions:
        if dimension.name in PLACE:
            continue
        shape = (size, dimension.num_elements) if dimension.num_elements > 1 else size
        if dimension.is_scaled:
            content[dimension.name] = rng.integers(-(2**15), 2**15, size) * 0.01 - 20.0
        elif dimension.kind == laspy.point.dims.DimensionKind.FloatingPoint:
            content[dimension.name] = rng.random(shape).astype(dimension.dtype.base)
        elif dimension.name == "scan_angle":
            content[dimension.name] = rng.integers(-30_000, 30_001, size)
        else:
            least, most = max(dimension.min, -largest), min(dimension.max, largest)
            kind = dimension.dtype or np.uint8
            content[dimension.name] = rng.integers(least, most, shape, kind, endpoint=True)
    content.write(path)
    return path


def columns(path):
    """All dimensions of a file by laspy, arrays as several, coordinates in metres."""
    content = laspy.read(path)
    found = {name: np.asarray(content[name]) for name in ("x", "y", "z")}
    for dimension in content.point_format.dimensions:
        if dimension.name in PLACE:
            continue
        values = np.asarray(content[dimension.name])
        if values.ndim == 1:
            found[dimension.name] = values
        else:
            found |= {f"{dimension.name[:29]}_{i}": values[:, i] for i in range(values.shape[1])}
    if "scan_angle_rank" in found:
        found["scan_angle"] = found.pop("scan_angle_rank") / 0.006
    return found


def header_of(path):
    with laspy.open(path) as reader:
        return reader.header


def require_same(before, after):
    for name, values in before.items():
        tolerance = SAME_PLACE if name in "xyz" else SAME
        if name == "scan_angle":
            npt.assert_allclose(after[name] * 0.006, values * 0.006, **RANK)
        else:
            # text holds as many digits of float32 as tell its values apart
            found = after[name].astype(np.float32 if values.dtype == np.float32 else None)
            npt.assert_allclose(found, values, err_msg=name, **tolerance)


@pytest.mark.slow
@pytest.mark.parametrize("ending", [".laz", ".las", ".zarr", ".parquet", ".csv"])
@pytest.mark.parametrize("point_format", FORMATS)
def test_every_dimension_survives(tmp_path, point_format, ending):
    """To another format and back to LAS, block by block, compared with laspy."""
    largest = EXACT_IN_TEXT if ending == ".csv" else 2**64
    before = write_las(tmp_path / "in.las", point_format, largest=largest)
    path = tmp_path / f"between{ending}"
    formats.write(formats.point_blocks(before, size=123), path)
    # text keeps numbers alone, not the steps that they were rounded to
    named = {"scale": 0.00025} if ending == ".csv" else {}
    formats.write(formats.point_blocks(path), tmp_path / "out.laz", **named)
    require_same(columns(before), columns(tmp_path / "out.laz"))
    written = header_of(tmp_path / "out.laz")
    assert written.point_format.id == {2: 7, 3: 7, 7: 7, 8: 8}.get(point_format, 6)
    npt.assert_allclose(written.scales, 0.00025, rtol=1e-12)


@pytest.mark.slow
@pytest.mark.parametrize("name", STRIPS)
def test_real_strips_are_copied_without_loss(data, tmp_path, name):
    path = data / "scanning" / "strips" / name
    formats.write(formats.point_blocks(path), tmp_path / "out.laz")
    require_same(columns(path), columns(tmp_path / "out.laz"))


def test_scaled_extra_bytes_stay_integers(tmp_path):
    write_las(tmp_path / "in.las", 6)
    formats.write(las.read(tmp_path / "in.las"), tmp_path / "out.las")
    dimension = header_of(tmp_path / "out.las").point_format.dimension_by_name("Reflectance")
    assert (dimension.dtype, dimension.scales[0], dimension.offsets[0]) == (np.int16, 0.01, -20.0)
    assert dimension.description.strip("\0 ") == "dB"


@settings(max_examples=60, deadline=None)
@given(
    scale=st.sampled_from([0.01, 0.001, 1e-4, 0.00025, 5e-5, 1e-5, 0.0003048, 0.01 * 1200 / 3937]),
    offset=st.sampled_from([0.0, 500000.0, 500000.5, 512345.00013, -0.00007]),
    steps=st.lists(st.integers(-(2**29), 2**29), min_size=1, max_size=20),
)
def test_coordinates_are_not_rounded_twice(tmp_path_factory, scale, offset, steps):
    path = tmp_path_factory.mktemp("steps")
    far = int(1e5 / max(scale, 1e-4))  # [steps] 100 km: 0.1 mm holds 214 km to either side
    x = np.clip(steps, -far, far) * scale + offset
    points = make_points(x, x, x).assign_attrs(
        coordinate_scale=[scale] * 3, coordinate_offset=[offset] * 3
    )
    las.write(points, path / "p.las")
    again = las.read(path / "p.las")
    for name in ("easting", "northing", "up"):
        npt.assert_allclose(again[name], x, **SAME_PLACE)
    assert max(again.attrs["coordinate_scale"]) <= max(scale, 1e-4)


def test_a_given_scale_is_used(tmp_path):
    write_las(tmp_path / "in.las", 6)
    formats.write(las.read(tmp_path / "in.las"), tmp_path / "out.las", scale=0.002)
    assert header_of(tmp_path / "out.las").scales.tolist() == [0.002] * 3


@pytest.mark.parametrize(
    ("variable", "values", "rule"),
    [
        ("return_number", [1, 16], "whole numbers from 0 to 15, got 16 at point 2"),
        ("classification", [2, 256], "from 0 to 255"),
        ("overlap", [0, 2], "from 0 to 1"),
        ("red", [0, -1], "from 0 to 65535"),
        ("scan_angle", [0.0, 3.3], "from -30000 to 30000"),
        ("extra_" + 33 * "a", [0, 1], "too long"),
        ("extra_classification", [0, 1], "means something else"),
    ],
)
def test_variables_that_las_cannot_hold_are_refused(tmp_path, variable, values, rule):
    points = make_points([0.0, 1.0], [0.0, 1.0], [0.0, 1.0], **{variable: values})
    with pytest.raises(SchemaError, match=rule):
        las.write(points, tmp_path / "p.las")
    assert not (tmp_path / "p.las").exists()


def test_wave_packets_are_reported_as_not_read(tmp_path):
    header = laspy.LasHeader(version="1.4", point_format=9)
    content = laspy.LasData(header)
    content.x, content.y, content.z = [0.0, 1.0], [0.0, 1.0], [0.0, 1.0]
    content.write(tmp_path / "p.las")
    assert las.read(tmp_path / "p.las").attrs["not_read"] == "wave packets"
    assert "wave packets are not read" in las.describe(tmp_path / "p.las")["problems"]


# ---- selection of variables


@pytest.mark.parametrize("ending", [".laz", ".zarr", ".parquet", ".csv"])
def test_readers_read_the_requested_variables(tmp_path, ending):
    source = write_las(tmp_path / "in.las", 8)
    path = tmp_path / f"p{ending}"
    formats.write(formats.point_blocks(source), path)
    every = formats.point_variables(path)
    assert set(every) == set(formats.point_variables(source))
    whole = formats.open(path)
    for names in ((), ("classification", "nir", "extra_plain u1", "no such"), every):
        block = next(formats.point_blocks(path, variables=names))
        assert set(block.data_vars) == {"easting", "northing", "up", *names} - {"no such"}
        for name in block.data_vars:
            npt.assert_array_equal(block[name], whole[name], err_msg=name)


# ---- classes and returns


FILTERS = [
    PointFilter(classes=(2,)),
    PointFilter(classes=(2, 6)),
    PointFilter(returns="first"),
    PointFilter(returns="last"),
    PointFilter(returns=2),
    PointFilter(classes=(6,), returns="last"),
]


@pytest.fixture
def returns(tmp_path):
    """A file of pulses with up to three returns, of three classes."""
    number = np.array([1, 1, 2, 1, 2, 3] * 50)
    points = make_points(
        np.arange(300) % 17,
        np.arange(300) % 13,
        np.arange(300.0),
        return_number=number,
        number_of_returns=np.array([1, 2, 2, 3, 3, 3] * 50),
        classification=np.array([2, 6, 2, 5] * 75),
        crs="EPSG:25832",
    )
    formats.write(points, tmp_path / "in.laz")
    return tmp_path / "in.laz"


@pytest.mark.parametrize("only", FILTERS, ids=str)
@pytest.mark.parametrize("ending", [".las", ".zarr", ".parquet", ".csv"])
def test_points_are_filtered_in_every_format(returns, tmp_path, ending, only):
    path = tmp_path / f"p{ending}"
    formats.write(formats.point_blocks(returns), path)
    whole = formats.open(returns)
    number, count = whole.return_number.values, whole.number_of_returns.values
    taken = np.isin(whole.classification, only.classes) if only.classes else np.ones(300, bool)
    taken &= {"first": number == 1, "last": number == count, 2: number == 2}.get(
        only.returns, taken
    )
    assert 0 < taken.sum() < 300
    npt.assert_array_equal(formats.open(path, only=only).up, whole.up[taken])
    blocks = list(formats.point_blocks(path, only=only, size=70, variables=()))
    npt.assert_array_equal(np.concatenate([block.up for block in blocks]), whole.up[taken])
    assert {name for block in blocks for name in block.data_vars} == {"easting", "northing", "up"}
    inside = taken & (whole.easting.values <= 5)
    bounds = (0.0, 0.0, 5.0, 20.0)
    blocks = formats.point_blocks(path, only=only, bounds=bounds)
    npt.assert_array_equal(np.concatenate([block.up for block in blocks]), whole.up[inside])


def test_filtering_without_the_variable_is_an_error(returns, tmp_path):
    with pytest.raises(CoverageError, match=r"none of 300 points is of class 9; .*classes 2: 150"):
        formats.open(returns, only=PointFilter(classes=(9,)))
    formats.write(make_points([0.0], [0.0], [0.0]), tmp_path / "bare.csv")
    with pytest.raises(FormatError, match=r"bare\.csv: variable classification: is missing"):
        next(formats.point_blocks(tmp_path / "bare.csv", only=PointFilter(classes=(2,))))
    for wrong in ({"classes": (256,)}, {"returns": 16}, {"returns": 0}, {"returns": "second"}):
        with pytest.raises(ValueError, match="must be"):
            PointFilter(**wrong)


def test_a_filter_is_a_table_of_settings():
    assert parse_settings(PointFilter, {"classes": [2, 11], "returns": "last"}) == PointFilter(
        classes=(2, 11), returns="last"
    )
    assert parse_settings(PointFilter, {"returns": 2}) == PointFilter(returns=2)


def test_missing_classes_are_not_counted(tmp_path):
    (tmp_path / "p.csv").write_text("x,y,z,classification\n0,0,1,2\n1,0,1,nan\n2,0,1,6\n")
    assert formats.info(tmp_path / "p.csv")["classes"] == {"2": 1, "6": 1}
    (only,) = formats.point_blocks(tmp_path / "p.csv", only=PointFilter(classes=(2,)))
    assert only.sizes["point"] == 1


@pytest.mark.parametrize("ending", [".las", ".zarr", ".parquet", ".csv"])
def test_info_counts_classes_and_returns(returns, tmp_path, ending):
    path = tmp_path / f"p{ending}"
    formats.write(formats.point_blocks(returns), path)
    summary = formats.info(path)
    assert summary["classes"] == {"2": 150, "5": 75, "6": 75}
    assert summary["returns"] == {"1": 150, "2": 100, "3": 50}
