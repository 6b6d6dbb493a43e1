"""The network: residual blocks on small pictures, pooled over bands of the body, one unit descriptor a crop.

Plain 3 x 3 convolutions of few channels rather than depthwise ones: on a CPU they do more work a millisecond, in
training above all.
"""

from __future__ import annotations

import torch
from torch import Tensor, nn
from torch.nn import functional

DIMENSIONS = 192
CHANNELS = (32, 64, 128)
BANDS = 4  # of the body, from the top


class Block(nn.Module):
    """Two convolutions and a way around them (He et al., "Deep residual learning", CVPR 2016)."""

    def __init__(self, before: int, channels: int, stride: int) -> None:
        super().__init__()
        self.first = _convolution(before, channels, stride=stride)
        self.second = _convolution(channels, channels)
        same = before == channels and stride == 1
        self.around = nn.Identity() if same else _convolution(before, channels, size=1, stride=stride)

    def forward(self, x: Tensor) -> Tensor:
        """Features (n, before, h, w) to (n, channels, h / stride, w / stride)."""
        return functional.relu(self.second(functional.relu(self.first(x))) + self.around(x))


class Network(nn.Module):
    """Crops (n, 3, 128, 64), normalised, to unit descriptors (n, 192).

    The mean of each band tells what is worn where (Sun et al., "Beyond part models", ECCV 2018), the maximum over all
    what is there at all, wherever an occluder pushed it.
    """

    def __init__(self) -> None:
        super().__init__()
        one, two, three = CHANNELS
        self.trunk = nn.Sequential(
            _convolution(3, one // 2, stride=2),
            nn.ReLU(),
            _convolution(one // 2, one, stride=2),
            nn.ReLU(),
            Block(one, one, 1),
            Block(one, two, 2),
            Block(two, three, 2),
        )
        self.descriptor = nn.Sequential(
            nn.Linear((BANDS + 1) * three, DIMENSIONS, bias=False), nn.BatchNorm1d(DIMENSIONS)
        )

    def forward(self, crops: Tensor) -> Tensor:
        """See the class."""
        features = self.trunk(crops)
        bands = [band.mean(dim=(2, 3)) for band in features.chunk(BANDS, dim=2)]
        pooled = torch.cat([*bands, features.amax(dim=(2, 3))], dim=1)
        return functional.normalize(self.descriptor(pooled), dim=1)


class Mirrored(nn.Module):
    """What a network says of a crop and of its mirror image, the mean of both: people look much alike mirrored.

    Twice the work, for better descriptors: of the clearest crops of people never seen a quarter fewer are taken for
    somebody else.
    """

    def __init__(self, network: Network) -> None:
        super().__init__()
        self.network = network

    def forward(self, crops: Tensor) -> Tensor:
        """Crops as the network takes them, (n, 3, 128, 64), to unit descriptors (n, 192)."""
        return functional.normalize(self.network(crops) + self.network(crops.flip(3)), dim=1)


def parameters(network: nn.Module) -> int:
    """How many numbers it has learnt."""
    return sum(parameter.numel() for parameter in network.parameters())


def _convolution(before: int, channels: int, *, size: int = 3, stride: int = 1) -> nn.Sequential:
    return nn.Sequential(nn.Conv2d(before, channels, size, stride, size // 2, bias=False), nn.BatchNorm2d(channels))
