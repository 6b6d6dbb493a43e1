import hashlib
import json
import os
import pickle
import subprocess
import sys
from dataclasses import replace

import numpy as np
import onnxruntime
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from onnx import TensorProto, helper, load, save
from onnx_graphs import Graph, mean_color

from mvpose.networks import Card, Session
from mvpose.networks.reid import DEFAULT


def crops(count=5, size=(32, 64), seed=1):
    return np.random.default_rng(seed).integers(0, 256, (count, size[1], size[0], 3), np.uint8)


def mean(pictures):
    return pictures.mean(axis=(1, 2)) / 255


@pytest.mark.parametrize(
    "options",
    [
        {},
        {"input_name": "data_0"},
        {"channels_last": True},
        {"batch": 1},
        {"batch": 16},
        {"card": Card(mean=(0, 0, 0), std=(1 / 255,) * 3)},
        {"card": Card(mean=(0.5, 0.4, 0.3), std=(0.1, 0.2, 0.3))},
        {"size": (33, 21)},
    ],
    ids=str,
)
@pytest.mark.parametrize("count", [0, 1, 5, 21])
def test_a_network_gets_the_normalised_crops(tmp_path, options, count):
    pictures = crops(count, options.get("size", (32, 64)))
    session = Session(mean_color(tmp_path / "net.onnx", **options), batch=4)
    assert session.shapes == ((3,),)
    (result,) = session(pictures)
    assert (result.shape, result.dtype) == ((count, 3), np.float32)
    np.testing.assert_allclose(result, mean(pictures), atol=1e-5)


def test_a_card_can_be_passed_separately(tmp_path):
    card = Card(mean=(0.1, 0.2, 0.3), std=(0.5, 0.6, 0.7))
    path = mean_color(tmp_path / "net.onnx", card=card, stated=Card())
    np.testing.assert_allclose(Session(path, card=card)(crops())[0], mean(crops()), atol=1e-5)
    assert np.abs(Session(path)(crops())[0] - mean(crops())).max() > 0.05
    assert Session(path).card == Card()


def test_channels_are_in_the_order_of_the_card(tmp_path):
    card = Card(color_order="bgr")
    session = Session(mean_color(tmp_path / "net.onnx", card=card))
    assert session.card == card
    np.testing.assert_allclose(session(crops())[0], mean(crops())[:, ::-1], atol=1e-5)


def test_half_precision_is_accurate_to_its_rounding(tmp_path):
    np.testing.assert_allclose(
        Session(mean_color(tmp_path / "net.onnx", half=True))(crops())[0], mean(crops()), atol=2e-3
    )


def test_half_precision_weights_with_single_precision_input_and_output(tmp_path):
    graph = Graph(("n", 3, 64, 32))
    graph.undo_normalisation(Card())
    graph.add("ReduceMean", axes=[2, 3], keepdims=0)
    graph.add("Cast", to=TensorProto.FLOAT16)
    graph.half = True
    graph.add("MatMul", graph.last, 2.0 * np.eye(3))
    graph.add("Cast", to=TensorProto.FLOAT)
    graph.output("features", ("n", 3))
    session = Session(graph.save(tmp_path / "net.onnx"))
    np.testing.assert_allclose(session(crops())[0], 2 * mean(crops()), atol=2e-3)


def test_an_open_size_is_read_from_the_card(tmp_path):
    path = mean_color(tmp_path / "net.onnx", size=("w", "h"))
    with pytest.raises(ValueError, match=r"leaves the width of its input 'input' open; give Card\(size="):
        Session(path)
    session = Session(path, card=Card(size=(32, 64)))
    assert session.size == (32, 64)
    np.testing.assert_allclose(session(crops())[0], mean(crops()), atol=1e-5)


def test_a_session_can_be_sent_to_another_process(tmp_path):
    card = Card(mean=(0.1, 0.2, 0.3))
    session = Session(mean_color(tmp_path / "net.onnx"), card=card, batch=2)
    twin = pickle.loads(pickle.dumps(session))
    assert (twin.path, twin.card, twin.size) == (session.path, card, (32, 64))
    np.testing.assert_array_equal(twin(crops())[0], session(crops())[0])


@pytest.mark.slow
def test_importing_networks_imports_neither_onnxruntime_nor_opencv():
    code = "import sys, mvpose.networks; print(*(m for m in ('onnxruntime', 'onnx', 'cv2') if m in sys.modules))"
    assert subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout.split() == []


def test_without_onnxruntime_it_names_the_extra(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "onnxruntime", None)
    with pytest.raises(ModuleNotFoundError, match=r"net\.onnx: onnxruntime is not installed.*'mvpose\[networks\]'"):
        Session(tmp_path / "net.onnx")


# What is refused.


def broken(path, content):
    path.write_bytes(content)
    return path


def test_a_missing_file_is_refused(tmp_path):
    for path in (tmp_path / "reid.onnx", tmp_path):
        with pytest.raises(ValueError, match=f"network {path}: no such file; expected an ONNX file"):
            Session(path)


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.floats(0, 1, exclude_max=True))
def test_a_truncated_file_is_refused(tmp_path, share):
    whole = mean_color(tmp_path / "net.onnx").read_bytes()
    with pytest.raises(ValueError, match=r"cut\.onnx: cannot be loaded: it is truncated, is not an ONNX file"):
        Session(broken(tmp_path / "cut.onnx", whole[: int(share * len(whole))]))


@pytest.mark.parametrize("content", [b"", b"not a network at all, but a letter", bytes(range(256)) * 40])
def test_a_file_that_is_not_onnx_is_refused(tmp_path, content):
    with pytest.raises(ValueError, match="cannot be loaded: it is truncated, is not an ONNX file"):
        Session(broken(tmp_path / "net.onnx", content))


@pytest.mark.parametrize(
    ("shape", "message"),
    [
        (("n", 100), r"input 'input' must be \(n, 3, height, width\) or \(n, height, width, 3\), got \['n', 100\]"),
        (("n", 3, 8, 8, 8), r"must be \(n, 3, height, width\)"),
        (("n", 1, 64, 32), r"must have 3 channels, red green blue, got \['n', 1, 64, 32\]"),
        (("n", 4, 64, 32), "must have 3 channels"),
    ],
)
def test_an_input_of_another_shape_is_refused(tmp_path, shape, message):
    graph = Graph(shape)
    graph.output("features", shape)
    with pytest.raises(ValueError, match=message):
        Session(graph.save(tmp_path / "net.onnx"))


def test_an_input_of_bytes_is_refused(tmp_path):
    graph = Graph(("n", 3, 64, 32), dtype=TensorProto.UINT8)
    graph.output("features", ("n", 3, 64, 32))
    with pytest.raises(ValueError, match=r"must be tensor\(float\) or tensor\(float16\), got tensor\(uint8\)"):
        Session(graph.save(tmp_path / "net.onnx"))


def test_two_inputs_are_refused(tmp_path):
    pictures = [helper.make_tensor_value_info(name, TensorProto.FLOAT, ("n", 3, 8, 4)) for name in ("a", "b")]
    total = helper.make_tensor_value_info("sum", TensorProto.FLOAT, ("n", 3, 8, 4))
    graph = helper.make_graph([helper.make_node("Add", ["a", "b"], ["sum"])], "sum", pictures, [total])
    save(helper.make_model(graph, opset_imports=[helper.make_opsetid("", 17)], ir_version=8), tmp_path / "net.onnx")
    with pytest.raises(ValueError, match="expected one input, a batch of pictures, got 2: 'a', 'b'"):
        Session(tmp_path / "net.onnx")


@pytest.mark.parametrize(("size", "message"), [((16, 64), "width 32"), ((32, 128), "height 64")])
def test_a_card_that_contradicts_the_file_is_refused(tmp_path, size, message):
    with pytest.raises(ValueError, match=rf"takes pictures of {message}, but its card has size = \({size[0]}, "):
        Session(mean_color(tmp_path / "net.onnx"), card=Card(size=size))


def test_a_bad_card_is_refused_with_the_name_of_its_file(tmp_path):
    graph = Graph(("n", 3, 64, 32))
    graph.output("features", ("n", 3, 64, 32))
    path = graph.save(tmp_path / "net.onnx", metadata={"mvpose.cell": '"area"'})
    with pytest.raises(ValueError, match=rf"network {path}: card: unknown field 'cell' .* expected one of name, size"):
        Session(path)


@pytest.mark.parametrize("half", [False, True])
def test_an_output_that_is_not_finite_is_refused(tmp_path, half):
    graph = Graph(("n", 3, 64, 32), half=half)
    graph.undo_normalisation(Card())
    mean = graph.add("ReduceMean", axes=[2, 3], keepdims=0)
    graph.add("Div", mean, np.zeros(3)) if not half else graph.add("Mul", mean, np.full(3, 6e4))
    graph.add("Mul", graph.last, np.full(3, 8.0))
    graph.output("features", ("n", 3))
    hint = "; float16 overflows beyond 65504: export in float32" if half else ""
    with pytest.raises(ValueError, match=f"output 'features' has values that are not finite{hint}$"):
        Session(graph.save(tmp_path / "net.onnx"))


def test_an_output_that_is_not_finite_for_one_crop_is_refused(tmp_path):
    graph = Graph(("n", 3, 64, 32))
    graph.undo_normalisation(Card())
    graph.add("ReduceMean", axes=[2, 3], keepdims=0)
    graph.add("Sub", graph.last, np.array(1e-3))
    graph.add("Log")  # of a black crop: not a number
    graph.output("features", ("n", 3))
    session = Session(graph.save(tmp_path / "net.onnx"))
    pictures = crops()
    assert np.isfinite(session(pictures)[0]).all()
    pictures[3] = 0
    with pytest.raises(ValueError, match="not finite"):
        session(pictures)


def pretender(path, operation, **attributes):
    """A file with an open batch size that only works for one crop."""
    graph = Graph(("n", 3, 64, 32))
    graph.add("ReduceMean", axes=[2, 3], keepdims=0)
    graph.add(operation, *([graph.last, np.array([1, 3])] if operation == "Reshape" else [graph.last]), **attributes)
    graph.output("features", () if operation == "ReduceMax" else ("a", "b"))
    return graph.save(path)


def test_a_failing_batch_is_refused_and_batch_1_works(tmp_path):
    path = pretender(tmp_path / "net.onnx", "Reshape")
    with pytest.raises(ValueError, match="fails on a batch of 2; if it takes one crop at a time, open it with batch=1"):
        Session(path)
    assert Session(path, batch=1)(crops())[0].shape == (5, 3)


@pytest.mark.parametrize(
    ("operation", "attributes", "got"), [("Flatten", {"axis": 0}, r"\(1, 6\)"), ("ReduceMax", {"keepdims": 0}, r"\(\)")]
)
def test_outputs_without_a_row_for_each_crop_are_refused(tmp_path, operation, attributes, got):
    with pytest.raises(ValueError, match=f"output 'features' must have a row for each of 2 crops, got {got}"):
        Session(pretender(tmp_path / "net.onnx", operation, **attributes))


def test_outputs_are_chosen_by_name(tmp_path):
    graph = Graph(("n", 3, 64, 32))
    graph.undo_normalisation(Card())
    graph.add("ReduceMean", axes=[2, 3], keepdims=0)
    graph.output("features", ("n", 3))
    graph.add("ArgMax", axis=1, keepdims=1)
    graph.output("identity", ("n", 1), dtype=TensorProto.INT64)
    path = graph.save(tmp_path / "net.onnx")
    with pytest.raises(ValueError, match="output 'identity' must be an array of floats, got int64"):
        Session(path)
    session = Session(path, card=Card(outputs=("features",)))
    np.testing.assert_allclose(session(crops())[0], mean(crops()), atol=1e-5)
    with pytest.raises(ValueError, match="has no output 'feature'; expected one of 'features', 'identity'"):
        Session(path, card=replace(session.card, outputs=("feature",)))


def test_crops_of_another_size_or_type_are_refused(tmp_path):
    session = Session(mean_color(tmp_path / "net.onnx"))
    for wrong, got in ((crops(size=(64, 32)), r"uint8 \(5, 32, 64, 3\)"), (crops() / 255, "float64")):
        with pytest.raises(ValueError, match=rf"crops must be \(m, 64, 32, 3\) uint8, got {got}"):
            session(wrong)


def test_providers_and_counts(tmp_path):
    path = mean_color(tmp_path / "net.onnx")
    assert Session(path).providers == ["CPUExecutionProvider"]
    assert "CPUExecutionProvider" in Session(path, provider="auto").providers
    with pytest.raises(ValueError, match="provider must be cpu, cuda or auto, got 'gpu'"):
        Session(path, provider="gpu")
    with pytest.raises(ValueError, match="batch and threads must be at least 1, got 0 and 1"):
        Session(path, batch=0)
    if "CUDAExecutionProvider" not in onnxruntime.get_available_providers():
        with pytest.raises(ValueError, match=r"provider 'cuda': this onnxruntime has only .*; install onnxruntime-gpu"):
            Session(path, provider="cuda")


@pytest.mark.filterwarnings("ignore:Specified provider")
def test_cuda_that_cannot_be_started_is_refused_if_requested(tmp_path, monkeypatch):
    """Onnxruntime lists providers that it was built with, and falls back to the CPU if one does not start."""
    path = mean_color(tmp_path / "net.onnx")
    if "CUDAExecutionProvider" in onnxruntime.get_available_providers():
        pytest.skip("CUDA is there")
    monkeypatch.setattr(
        onnxruntime, "get_available_providers", lambda: ["CUDAExecutionProvider", "CPUExecutionProvider"]
    )
    with pytest.raises(ValueError, match=r"provider 'cuda': CUDA cannot be started here, .* on CPUExecutionProvider; "):
        Session(path, provider="cuda")
    assert Session(path, provider="auto").providers == ["CPUExecutionProvider"]


def apart(path):
    """A network with weights in a separate file."""
    model = load(mean_color(path))
    save(model, path, save_as_external_data=True, location="weights.bin", size_threshold=0)
    return path, path.with_name("weights.bin")


def test_missing_or_truncated_external_weights_are_reported(tmp_path):
    path, weights = apart(tmp_path / "net.onnx")
    np.testing.assert_allclose(Session(path)(crops())[0], mean(crops()), atol=1e-5)
    weights.write_bytes(weights.read_bytes()[:-1])
    for _ in range(2):
        with pytest.raises(ValueError, match="its weights are in a separate file, which is missing or truncated"):
            Session(path)
        weights.unlink(missing_ok=True)


@pytest.mark.parametrize("newer", ["opset", "format"])
def test_a_file_of_a_newer_onnx_version_is_reported(tmp_path, newer):
    folder = tmp_path / "external data"
    folder.mkdir()
    model = load(mean_color(folder / "net.onnx"))
    if newer == "opset":
        model.opset_import[0].version = 99
    else:
        model.ir_version = 99
    save(model, folder / "net.onnx")
    with pytest.raises(
        ValueError, match=r"it has a newer ONNX version than onnxruntime .* reads\. Install a newer onnxruntime"
    ):
        Session(folder / "net.onnx")


def test_an_input_without_fixed_shape_is_given_channels_first(tmp_path):
    card = Card(size=(32, 64))
    for channels_last in (False, True):
        graph = Graph(("n", "a", "b", "c"))
        graph.undo_normalisation(Card(), channels_last)
        graph.add("ReduceMean", axes=[1, 2] if channels_last else [2, 3], keepdims=0)
        graph.output("features", ("n", 3))
        path = graph.save(tmp_path / "net.onnx")
        if not channels_last:
            np.testing.assert_allclose(Session(path, card=card)(crops())[0], mean(crops()), atol=1e-5)
        else:
            with pytest.raises(ValueError, match=r"if it takes \(n, height, width, 3\), export it with a fixed shape"):
                Session(path, card=card)


# The card beside a file.


def carded(path):
    """A network with a model card beside it."""
    digest = hashlib.sha256(mean_color(path).read_bytes()).hexdigest()
    path.with_suffix(".json").write_text(json.dumps({"name": "ours", "sha256": digest}))
    return path, digest


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.floats(0, 1, exclude_max=True), st.integers(1, 255))
def test_one_changed_byte_is_refused_by_the_digest(tmp_path, where, change):
    path, digest = carded(tmp_path / "net.onnx")
    assert Session(path).size == (32, 64)
    content = bytearray(path.read_bytes())
    content[int(where * len(content))] ^= change
    got = hashlib.sha256(broken(path, bytes(content)).read_bytes()).hexdigest()
    card = path.with_suffix(".json")
    with pytest.raises(
        ValueError, match=f"{path}: is not the file of this card: {card} .* {digest}, the file has {got} "
    ):
        Session(path)


def test_the_shipped_network_truncated_in_its_metadata_is_refused(tmp_path):
    for suffix in (".onnx", ".json"):
        (tmp_path / "reid").with_suffix(suffix).write_bytes(DEFAULT.with_suffix(suffix).read_bytes())
    path = tmp_path / "reid.onnx"
    assert Session(path).card.midpoint == Session(DEFAULT).card.midpoint
    for missing in (1, 100, 392):
        broken(path, DEFAULT.read_bytes()[:-missing])
        with pytest.raises(ValueError, match="is not the file of this card"):
            Session(path)


@pytest.mark.parametrize("beside", ["{}", '{"sha256": null}', '{"task": "pose"}'])
def test_a_card_without_a_digest_is_ignored(tmp_path, beside):
    path = mean_color(tmp_path / "net.onnx")
    path.with_suffix(".json").write_text(beside)
    np.testing.assert_allclose(Session(path)(crops())[0], mean(crops()), atol=1e-5)


@pytest.mark.parametrize("beside", ["", "[1]", "5", "not JSON", '{"sha256": 7}', "\xff", "[" * 100_000, "9" * 5000])
def test_a_card_that_cannot_be_read_is_refused(tmp_path, beside):
    path = mean_color(tmp_path / "net.onnx")
    path.with_suffix(".json").write_bytes(beside.encode("latin-1"))
    with pytest.raises(ValueError, match=r"net\.json: "):
        Session(path)


@pytest.mark.parametrize("kind", ["pipe", "folder", "device"])
def test_a_card_that_is_no_regular_file_is_refused(tmp_path, kind):
    path = mean_color(tmp_path / "net.onnx")
    card = path.with_suffix(".json")
    {"pipe": os.mkfifo, "folder": os.mkdir, "device": lambda card: card.symlink_to("/dev/zero")}[kind](card)
    with pytest.raises(ValueError, match=r"net\.json: cannot be read as the card of net\.onnx: it is no regular file"):
        Session(path)
