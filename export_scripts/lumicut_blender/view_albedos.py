# SPDX-License-Identifier: Apache-2.0
"""What lobes that are not the library's reflect of even light, by the cosine to the viewer (arrays): a diffuse part of
that albedo stands for them."""
import numpy as np

ACROSS, AROUND = 48, 48  # directions of light, over the projected hemisphere


def _over_light(reflected, cosine):
    """Mean over the projected hemisphere of π f; reflected: of cosines to the viewer, to the light, between the two."""
    view = np.clip(np.asarray(cosine, np.float64), 0.01, 1)[:, None, None]
    light = np.sqrt((np.arange(ACROSS) + 0.5) / ACROSS)[None, :, None]
    turn = np.cos((np.arange(AROUND) + 0.5) * np.pi / AROUND)[None, None, :]
    between = view * light + np.sqrt((1 - view ** 2) * (1 - light ** 2)) * turn
    return (np.pi * reflected(view, light, np.clip(between, -1, 1))).mean((1, 2))


def velvet(cosine, sigma):
    """Ashikhmin, Premože and Shirley 2000: facets that stand up, and shadows as in V grooves."""
    def reflected(view, light, between):
        half = np.sqrt(np.maximum(2 + 2 * between, 1e-9))
        normal, across = np.minimum((view + light) / half, 1 - 1e-5), np.maximum((1 + between) / half, 1e-5)
        sine2 = 1 - normal ** 2
        facets = np.exp(-(normal ** 2) / sine2 / sigma ** 2) / (np.pi * sigma ** 2 * sine2 ** 2)
        shadow = np.minimum(1, 2 * normal / across * np.minimum(view, light))
        return 0.25 * facets * shadow / (view * light)

    return _over_light(reflected, cosine)


def schlick_sheen(cosine):
    """Burley 2012: Schlick's (1 - cosine to the half vector)^5, without a divisor π."""
    return _over_light(lambda view, light, between: (1 - np.sqrt((1 + between) / 2)) ** 5, cosine)


# Albedo of the microfibers of Zeltner, Burley and Chiang 2022, by roughness in steps of 0.1 and by cosine: a ball of the
# Sheen BSDF under an even sky, rendered by Cycles 4.3.
COSINES = (0.03, 0.0625, 0.125, 0.1875, 0.25, 0.375, 0.5, 0.625, 0.75, 0.875, 1)
MICROFIBERS = (
    (0.446, 0.381, 0.050, 0.000, 0.000, 0.000, 0.000, 0.000, 0.000, 0.000, 0.000),
    (0.513, 0.442, 0.094, 0.004, 0.001, 0.000, 0.000, 0.000, 0.000, 0.000, 0.000),
    (0.651, 0.594, 0.288, 0.112, 0.047, 0.007, 0.002, 0.001, 0.000, 0.000, 0.000),
    (0.714, 0.669, 0.422, 0.263, 0.171, 0.061, 0.022, 0.008, 0.003, 0.002, 0.001),
    (0.747, 0.708, 0.499, 0.369, 0.285, 0.152, 0.078, 0.038, 0.019, 0.009, 0.005),
    (0.766, 0.733, 0.548, 0.442, 0.372, 0.243, 0.154, 0.094, 0.056, 0.033, 0.020),
    (0.782, 0.751, 0.585, 0.497, 0.438, 0.324, 0.234, 0.165, 0.114, 0.077, 0.052),
    (0.795, 0.767, 0.616, 0.543, 0.494, 0.395, 0.310, 0.241, 0.184, 0.140, 0.107),
    (0.809, 0.784, 0.646, 0.583, 0.542, 0.456, 0.381, 0.316, 0.261, 0.214, 0.179),
    (0.824, 0.800, 0.675, 0.620, 0.584, 0.509, 0.444, 0.386, 0.336, 0.294, 0.260),
    (0.838, 0.817, 0.702, 0.653, 0.621, 0.556, 0.499, 0.450, 0.407, 0.372, 0.344))


def microfibers(cosine, roughness):
    row = min(max(roughness, 0.0), 1.0) * (len(MICROFIBERS) - 1)
    low = min(int(row), len(MICROFIBERS) - 2)
    table = np.asarray(MICROFIBERS[low]) * (low + 1 - row) + np.asarray(MICROFIBERS[low + 1]) * (row - low)
    return np.interp(cosine, COSINES, table)
