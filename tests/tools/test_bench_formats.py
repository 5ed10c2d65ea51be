"""The table of file formats: every format there, with what it can hold."""

import json

from observer_rt.files.formats import log_formats, signal_formats, suffixes_of, written
from tools.benchmarks.formats import formats_document, measure_formats


def test_every_format_is_measured() -> None:
    results = {result.name: result for result in measure_formats(1000)}
    assert set(results) == {
        *suffixes_of(written(log_formats())),
        *(f"{suffix} classic" for suffix in suffixes_of(written(log_formats())) if suffix != ".trc"),
        *(f"{suffix} signals" for suffix in suffixes_of(written(signal_formats()))),
    }
    with_fd = {name for name, result in results.items() if result.holds == "frames of CAN FD"}
    assert with_fd == {*suffixes_of(written(log_formats()))} - {".trc"}
    assert all((result.faster is None) == name.endswith("signals") for name, result in results.items())
    assert all(result.stamp_error_ns == 0 for name, result in results.items() if name != ".trc")
    assert 0 < results[".trc"].stamp_error_ns <= 500
    assert all(result.written_per_s > 0 and result.read_per_s > 0 for result in results.values())
    document = json.loads(json.dumps(formats_document(list(results.values()))))
    assert document["figures"]["blf_read_per_s"] > 0
    assert document["figures"]["asc_classic_times_python_can"] > 0
