"""Kernel of the image sensor: light on its pixels, through the lens and the colour filters, with noise.

A lens that blurs by ``sigma`` pixels and images a colour ``shift`` pixels beside its place is one filter of three taps
along each axis, the only one with the sum 1, the mean ``shift`` and the variance ``sigma^2``. All work is done in loops
along rows without branches, on slices of equal length, so that the compiler vectorises them.
"""

from __future__ import annotations

import math

import numpy as np

from mvpose.kernels import njit


@njit(cache=True)
def expose(rgb, linear, words, normals, axis, falloff, variance, aberration, shot, read, levels, mosaic, raw):
    """Write the values that a sensor reads.

    Args:
        rgb: the picture, (h, w, 3) uint8.
        linear: light that its values stand for, (256,) float32, 1 is white.
        words: random numbers, (c, h, w) uint16; no elements for no noise.
        normals: quantiles of the standard normal distribution, (4096,) float32.
        axis: column and row of the optical axis, and 1 / focal length^2, pixels, (3,) float32.
        falloff: coefficients of the polynomial of cos^2 that gives the share of light far from the axis, (k,) float32,
            the highest power first.
        variance: variance of the blur along each axis, pixels^2, float32.
        aberration: magnification of red over that of green, less 1; that of blue is as much smaller; float32.
        shot: variance of the noise of light at white, float32.
        read: variance of the noise of the readout, float32.
        levels: values of black and white, (2,) float32.
        mosaic: whether every pixel has one colour filter, red and green in even rows, green and blue in odd ones.
        raw: the result, (c, h, w) uint16, c is 1 for a mosaic, else 3.
    """
    height, width = rgb.shape[:2]
    aside = np.empty(width, np.float32)
    for x in range(width):
        aside[x] = np.float32(x) - axis[0]
    pad = math.ceil(abs(aberration) * max(abs(aside[0]), abs(aside[-1]))) + 2
    column = np.empty(width + 2 * pad, np.float32)
    share, cosine, rows = np.empty(width, np.float32), np.empty(width, np.float32), np.empty((3, width), np.float32)
    lines, held = np.empty((3, 3, width), np.float32), np.zeros((3, 3), np.int64)  # the last rows of light, and which
    mixed = np.empty(width, np.float32)
    for y in range(height):
        beside = np.float32(y) - axis[1]
        _falloff_of_row(aside, beside * beside, axis[2], falloff, cosine, share)
        for channel in range(3):
            if not mosaic or channel == 1 or channel == 2 * (y & 1):
                magnified = np.float32(channel - 1) * aberration  # where the light of a pixel comes from
                shift = beside * magnified
                whole = math.floor(shift + np.float32(0.5))
                middle = min(max(y + int(whole), 0), height - 1)
                above, below = max(middle - 1, 0), min(middle + 1, height - 1)
                for line in range(above, below + 1):
                    if held[channel, line % 3] != 1 + line:
                        _read_light(rgb[line], channel, linear, lines[channel, line % 3])
                        held[channel, line % 3] = 1 + line
                _filter_column(
                    lines[channel, above % 3],
                    lines[channel, middle % 3],
                    lines[channel, below % 3],
                    shift - np.float32(whole),
                    variance,
                    column[pad : pad + width],
                )
                column[:pad] = column[pad]
                column[pad + width :] = column[pad + width - 1]
                _filter_row(column, pad, aside, magnified, variance, share, rows[channel])
        if mosaic:
            _interleave(rows[y & 1], rows[1 + (y & 1)], mixed)
        for channel in range(len(raw)):
            row = mixed if mosaic else rows[channel]
            _read_row(row, words[:, y], channel, normals, shot, read, levels, raw[channel, y])


@njit(cache=True)
def _falloff_of_row(aside, beside, curvature, falloff, cosine, share):
    """Write the share of light that reaches each pixel of a row: a polynomial of the squared cosine of its angle."""
    for x in range(len(share)):
        cosine[x] = np.float32(1) / (np.float32(1) + (aside[x] * aside[x] + beside) * curvature)
    share[:] = falloff[0]
    for k in range(1, len(falloff)):
        factor = falloff[k]
        for x in range(len(share)):
            share[x] = share[x] * cosine[x] + factor


@njit(cache=True)
def _read_light(line, channel, linear, light):
    """Write the light of one row of a picture and one colour."""
    for x in range(len(light)):
        light[x] = linear[line[x, channel]]


@njit(cache=True)
def _filter_column(above, same, below, shift, variance, row):
    """Write a row of light, filtered along the columns."""
    half, one = np.float32(0.5), np.float32(1)
    spread = variance + shift * shift
    before, here, after = half * (spread - shift), one - spread, half * (spread + shift)
    for x in range(len(row)):
        row[x] = before * above[x] + here * same[x] + after * below[x]


@njit(cache=True)
def _filter_row(column, pad, aside, magnified, variance, share, row):
    """Write the light on one row, filtered along the row; the shift grows with the distance from the axis."""
    half = np.float32(0.5)
    start, width = 0, len(row)
    while start < width:  # stretches in which the nearest pixel is equally far away
        offset = math.floor(aside[start] * magnified + half)
        end = width
        if magnified != 0 and math.floor(aside[width - 1] * magnified + half) != offset:
            end = start + 1
            while end < width and math.floor(aside[end] * magnified + half) == offset:
                end += 1
        first = pad + start + int(offset)
        _filter_stretch(
            column[first - 1 : first - 1 + end - start],
            column[first : first + end - start],
            column[first + 1 : first + 1 + end - start],
            aside[start:end],
            magnified,
            np.float32(offset),
            variance,
            share[start:end],
            row[start:end],
        )
        start = end


@njit(cache=True)
def _filter_stretch(left, same, right, aside, magnified, offset, variance, share, row):
    half, one = np.float32(0.5), np.float32(1)
    for x in range(len(row)):
        shift = aside[x] * magnified - offset
        spread = variance + shift * shift
        value = half * (spread - shift) * left[x] + (one - spread) * same[x] + half * (spread + shift) * right[x]
        row[x] = share[x] * value


@njit(cache=True)
def _interleave(even, odd, row):
    """Write the pixels of even columns from one row and those of odd columns from another."""
    for x in range(len(row)):
        row[x] = odd[x] if x & 1 else even[x]


@njit(cache=True)
def _read_row(row, words, channel, normals, shot, read, levels, raw):
    """Write light as numbers with noise, whose variance grows with the light: the counted photons, and the readout."""
    if words.size:
        draws = words[channel]
        for x in range(len(row)):
            light = row[x] if row[x] > 0 else np.float32(0)
            row[x] += math.sqrt(shot * light + read) * normals[draws[x] >> 4]
    scale, bias, top = levels[1] - levels[0], levels[0] + np.float32(0.5), levels[1]
    for x in range(len(row)):
        value = row[x] * scale + bias
        value = value if value > 0 else np.float32(0)
        raw[x] = np.uint16(value if value < top else top)


@njit(cache=True)
def look_up(raw, table, rgb):
    """Write the colours ``rgb`` (h, w, 3) uint8 that a table (3, n) has for raw values (h, w, 3) uint16."""
    red, green, blue = table[0], table[1], table[2]
    for y in range(raw.shape[0]):
        for x in range(raw.shape[1]):
            rgb[y, x, 0] = red[raw[y, x, 0]]
            rgb[y, x, 1] = green[raw[y, x, 1]]
            rgb[y, x, 2] = blue[raw[y, x, 2]]
