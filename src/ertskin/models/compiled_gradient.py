"""The masked network's gradient in a few compiled passes.

Between layers of thirty-six neurons and batches of thirty-two, each operation of a library costs more to call than to
compute: some hundred and fifty of them were two thirds of a step of training.
"""

from __future__ import annotations

import numpy as np
import torch
from numba import njit
from numpy.typing import NDArray
from torch import Tensor, nn

from ertskin.models.batch_norm import BatchNorm
from ertskin.models.readings_layer import ReadingsLayer

Values = NDArray[np.float32]


class CompiledGradient:
    """Called with a mini-batch: its loss in training, the gradient of all parameters in their ``grad``.

    For two parts behind one layer of readings and its normalisation, half of whose columns each takes. ``location`` and
    ``force``: activation, linear layer, normalisation, activation, linear layer; of sigmoids the first, of ReLUs the
    second, at the output too. The same mathematics as ``TouchNetwork.losses`` and autograd's, in single precision on a
    processor. It holds views of the weights: make a new one when they may have been replaced.
    """

    def __init__(self, readings: ReadingsLayer, norm: BatchNorm, location: nn.Sequential, force: nn.Sequential) -> None:
        self.readings = readings
        self.bias_gradient = _graded(readings.bias)
        half = norm.num_features // 2
        self.location = _Part(norm, slice(None, half), location)
        self.force = _Part(norm, slice(half, None), force)

    @torch.no_grad()
    def __call__(self, inputs: Tensor, targets: dict[str, Tensor]) -> Tensor:
        """(N,P) pair resistances, (N,n) ``touched`` and ``force_n`` to the sum of both parts' losses."""
        entered = torch.addmm(self.readings.bias, inputs, self.readings.combined())
        back = torch.empty_like(entered)
        values, slopes = entered.numpy(), back.numpy()
        touched, force_n = targets["touched"].numpy(), targets["force_n"].numpy()
        loss = self.location.passed(True, values, touched, force_n, slopes)
        loss += self.force.passed(False, values, touched, force_n, slopes)
        torch.sum(back, dim=0, out=self.bias_gradient)
        self.readings.weight.grad = self.readings.spread(inputs.t() @ back)
        return torch.tensor(loss, dtype=torch.float32)


class _Part:
    """One part's weights, running statistics and gradients as arrays."""

    def __init__(self, norm: BatchNorm, columns: slice, rest: nn.Sequential) -> None:
        _, inner, second, _, outer = rest
        layers = [*inner.parameters(), *second.parameters(), *outer.parameters()]
        shared = [norm.weight, norm.bias]
        self.columns = columns
        self.constants = np.float32(norm.momentum), np.float32(norm.eps)
        self.running = (
            *(each[columns] for each in _statistics(norm)),
            *_statistics(second),
        )
        self.weights = (*(_array(each)[columns] for each in shared), *map(_array, layers))
        self.gradients = (
            *(_graded(each).numpy()[columns] for each in shared),
            *(_graded(each).numpy() for each in layers),
        )

    def passed(self, locates: bool, entered: Values, touched: Values, force_n: Values, back: Values) -> float:
        """The loss; the gradients are filled, and the part's columns of ``back`` with that of ``entered``."""
        mine = entered[:, self.columns], touched, force_n
        gradients = (back[:, self.columns], *self.gradients)
        return float(_pass(locates, *self.constants, *mine, self.running, self.weights, gradients))


def _array(values: Tensor) -> Values:
    return np.asarray(values.detach().numpy())


def _statistics(norm: nn.Module) -> tuple[Values, Values]:
    assert isinstance(norm, BatchNorm)
    assert norm.running_mean is not None
    assert norm.running_var is not None
    return _array(norm.running_mean), _array(norm.running_var)


def _graded(parameter: Tensor) -> Tensor:
    """The parameter's gradient, made where there is none."""
    if parameter.grad is None:
        parameter.grad = torch.zeros_like(parameter)
    return parameter.grad


@njit(cache=True)
def _pass(
    locates: bool,
    momentum: np.float32,
    eps: np.float32,
    entered: Values,
    touched: Values,
    force_n: Values,
    running: tuple[Values, ...],
    weights: tuple[Values, ...],
    gradients: tuple[Values, ...],
) -> float:
    """Forward through the part, then backward; fills ``gradients``, moves ``running``, returns the loss."""
    mean, var, second_mean, second_var = running
    scale, shift, inner, inner_bias, second_scale, second_shift, outer, outer_bias = weights
    first, first_width = _normalised(entered, mean, var, momentum, eps)
    first_out = _activated(locates, first, scale, shift)
    middle = _layer(first_out, inner, inner_bias)
    second, second_width = _normalised(middle, second_mean, second_var, momentum, eps)
    second_out = _activated(locates, second, second_scale, second_shift)
    result = _layer(second_out, outer, outer_bias)
    loss = _compared(locates, result, touched, force_n)
    back = _layer_back(result, second_out, outer, gradients[7], gradients[8])
    _activated_back(locates, back, second_out)
    _normalised_back(back, second, second_width, second_scale, gradients[5], gradients[6])
    back = _layer_back(back, first_out, inner, gradients[3], gradients[4])
    _activated_back(locates, back, first_out)
    _normalised_back(back, first, first_width, scale, gradients[1], gradients[2])
    gradients[0][:] = back
    return loss


@njit(cache=True)
def _layer(values: Values, weight: Values, bias: Values) -> Values:
    turned = weight.T.copy()
    result = np.empty((len(values), len(weight)), np.float32)
    for n in range(len(values)):
        row = result[n]
        row[:] = bias
        for i in range(values.shape[1]):
            value, of_input = values[n, i], turned[i]
            for o in range(len(row)):
                row[o] += value * of_input[o]
    return result


@njit(cache=True)
def _layer_back(gradient: Values, values: Values, weight: Values, of_weight: Values, of_bias: Values) -> Values:
    """The gradient of ``values``; fills those of weight and bias."""
    of_weight[:], of_bias[:] = 0, 0
    result = np.zeros_like(values)
    for n in range(len(values)):
        row, value = result[n], values[n]
        for o in range(len(weight)):
            slope, of_output, known = gradient[n, o], of_weight[o], weight[o]
            of_bias[o] += slope
            for i in range(len(row)):
                row[i] += slope * known[i]
                of_output[i] += slope * value[i]
    return result


@njit(cache=True)
def _normalised(
    values: Values, mean: Values, var: Values, momentum: np.float32, eps: np.float32
) -> tuple[Values, Values]:
    """Less the batch's mean, in widths of the batch, and one over the widths; moves the running ``mean``, ``var``."""
    count, features = values.shape
    middle, square = np.zeros(features, np.float32), np.zeros(features, np.float32)
    for n in range(count):
        for i in range(features):
            middle[i] += values[n, i]
    middle /= np.float32(count)
    result = np.empty((count, features), np.float32)
    for n in range(count):
        for i in range(features):
            result[n, i] = values[n, i] - middle[i]
            square[i] += result[n, i] * result[n, i]
    square /= np.float32(count)
    unbiased = np.float32(count / (count - 1))
    width = np.empty(features, np.float32)
    for i in range(features):
        mean[i] += momentum * (middle[i] - mean[i])
        var[i] += momentum * (unbiased * square[i] - var[i])
        width[i] = np.float32(1) / np.sqrt(square[i] + eps)
    for n in range(count):
        for i in range(features):
            result[n, i] *= width[i]
    return result, width


@njit(cache=True)
def _normalised_back(
    gradient: Values, normal: Values, width: Values, scale: Values, of_scale: Values, of_shift: Values
) -> None:
    """Turns the gradient behind the normalisation into that before it; fills those of scale and shift."""
    count, features = gradient.shape
    of_scale[:], of_shift[:] = 0, 0
    for n in range(count):
        for i in range(features):
            of_shift[i] += gradient[n, i]
            of_scale[i] += gradient[n, i] * normal[n, i]
    share = np.float32(1 / count)
    for n in range(count):
        for i in range(features):
            beyond = gradient[n, i] - share * (of_shift[i] + normal[n, i] * of_scale[i])
            gradient[n, i] = scale[i] * width[i] * beyond


@njit(cache=True)
def _activated(sigmoid: bool, normal: Values, scale: Values, shift: Values) -> Values:
    result = np.empty_like(normal)
    for n in range(len(normal)):
        for i in range(len(scale)):
            result[n, i] = scale[i] * normal[n, i] + shift[i]
    if sigmoid:
        return np.float32(1) / (np.float32(1) + np.exp(-result))
    return np.maximum(result, np.float32(0))


@njit(cache=True)
def _activated_back(sigmoid: bool, gradient: Values, activated: Values) -> None:
    for n in range(len(gradient)):
        for i in range(gradient.shape[1]):
            value = activated[n, i]
            if sigmoid:
                gradient[n, i] *= value * (np.float32(1) - value)
            elif value <= 0:
                gradient[n, i] = np.float32(0)


@njit(cache=True)
def _compared(locates: bool, result: Values, touched: Values, force_n: Values) -> float:
    """The loss; puts its gradient in the result's place."""
    loss, share = 0.0, np.float32(1 / result.size)
    for n in range(len(result)):
        for o in range(result.shape[1]):
            value, target = result[n, o], touched[n, o]
            if locates:
                small = np.exp(-np.abs(value))
                loss += max(value, np.float32(0)) - value * target + np.log1p(small)
                chance = (np.float32(1) if value >= 0 else small) / (np.float32(1) + small)
                result[n, o] = share * (chance - target)
            else:
                wrong = target * (max(value, np.float32(0)) - force_n[n, o])
                loss += wrong * wrong
                result[n, o] = np.float32(2) * share * target * wrong if value > 0 else np.float32(0)
    return loss / result.size
