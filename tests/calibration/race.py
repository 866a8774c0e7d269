"""Every test of a configuration in one race on white innovations, written apart from the step that runs them.

The filter is the healthy course's, repeated; the innovations are N(0, 1); a test starts anew with its alarm, all cells
with that of one.
"""

from __future__ import annotations

import math

import numba
import numpy as np


@numba.njit(error_model="numpy")
def _cells(k, W, e, phi, llr, count, course, cells):
    """One reading through the bank; True where a cell raises the alarm."""
    sensor, dof, H, K, root, D, T, B = course
    who, channel, drives, theta, limit, age, band = cells
    n, w, alarm, p = T.shape[1], k % W, False, np.zeros(T.shape[1])
    for c in range(len(theta)):
        for i in range(n):
            p[i] = B[w, i, channel[c]] if drives[c] else 0.0
            for j in range(n):
                p[i] += T[w, i, j] * phi[c, j]
        gain = 0.0
        for i in range(dof[w]):
            rho = D[w, i, channel[c]] if not drives[c] and who[c] == sensor[w] else 0.0
            for j in range(n):
                rho -= H[w, i, j] * p[j]
            shift = theta[c] * rho / root[w, i]
            if abs(shift) > band:
                edge = math.copysign(band, shift)
                gain += (shift - edge) * (e[i] - 0.5 * (shift + edge))
            for j in range(n):
                p[j] += K[w, i, j] * rho
        llr[c] += gain
        count[c] += 1 if drives[c] or who[c] == sensor[w] else 0
        alarm = alarm or llr[c] >= limit[c]
        anew = llr[c] <= 0.0 or count[c] > age[c]
        if anew:
            llr[c], count[c] = 0.0, 0
        for j in range(n):
            phi[c, j] = 0.0 if anew else p[j]
    return alarm


@numba.njit(error_model="numpy")
def _scatter(s, e, dof, variance, pooled, white, last, variance_h, pooled_h, white_h, single):
    """One reading through the tests of variance and whiteness; True where one raises the alarm."""
    square = product = before = 0.0
    for i in range(dof):
        square += e[i] ** 2
        product += e[i] * last[s, i]
        before += last[s, i] ** 2
        last[s, i] = min(max(e[i], -4.0), 4.0)
    alarm = False
    for a in range(2):
        sign = 1.0 if a == 0 else -1.0
        ratio, slope = 4.0**sign, 0.3 * sign
        gain = 0.5 * square * (1.0 - 1.0 / ratio) - 0.5 * dof * math.log(ratio)
        variance[s, a] = max(0.0, variance[s, a] + min(gain, single * variance_h[s, a]))
        ratio = 1.5**sign
        gain = 0.5 * square * (1.0 - 1.0 / ratio) - 0.5 * dof * math.log(ratio)
        pooled[a] = max(0.0, pooled[a] + min(gain, single * pooled_h[a]))
        gain = slope * product - 0.5 * slope**2 * before
        white[s, a] = max(0.0, white[s, a] + min(gain, single * white_h[s, a]))
        if variance[s, a] >= variance_h[s, a]:
            alarm, variance[s, a] = True, 0.0
        if white[s, a] >= white_h[s, a]:
            alarm, white[s, a] = True, 0.0
        if pooled[a] >= pooled_h[a]:
            alarm, pooled[a] = True, 0.0
    return alarm


@numba.njit(error_model="numpy")
def race(rng, readings, course, cells, variance_h, pooled_h, white_h):
    """Alarms in so many readings."""
    W, m, n = len(course[0]), course[4].shape[1], course[6].shape[1]
    C, S = len(cells[3]), len(variance_h)
    phi, llr, count, e = np.zeros((C, n)), np.zeros(C), np.zeros(C), np.zeros(m)
    variance, pooled, white, last = np.zeros((S, 2)), np.zeros(2), np.zeros((S, 2)), np.zeros((S, m))
    alarms = 0
    for k in range(readings):
        s, dof = course[0][k % W], course[1][k % W]
        for i in range(dof):
            e[i] = rng.standard_normal()
        hit = _cells(k, W, e, phi, llr, count, course, cells)
        if _scatter(s, e, dof, variance, pooled, white, last, variance_h, pooled_h, white_h, 0.9) or hit:
            alarms += 1
        if hit:
            phi[:], llr[:], count[:] = 0.0, 0.0, 0.0
    return alarms


def measured_over_promised(detection, seed, readings):
    """Mean time between false alarms over the promised one, and how many alarms it is the mean of."""
    one = detection.course
    inputs = one.B if one.B.shape[2] else np.zeros((*one.B.shape[:2], 1))
    course = (one.sensor, one.dof, one.H, one.K, one.root, one.D, one.T, inputs)
    cells = (
        detection.cell_sensor, detection.cell_channel, detection.cell_is_input, detection.cell_theta,
        detection.cell_h, detection.cell_age.astype(float), detection.promise.dead_band,
    )  # fmt: skip
    course = tuple(np.ascontiguousarray(array) for array in course)
    limits = (detection.variance_h, detection.pooled_h, detection.white_h)
    alarms = race(np.random.default_rng(seed), readings, course, cells, *limits)
    lasted_s = readings / len(one) * one.period_s
    return lasted_s / alarms / detection.promise.interval_s, alarms
