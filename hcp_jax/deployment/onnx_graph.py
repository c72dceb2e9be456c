"""A JAX function as an ONNX graph: its jaxpr, primitive by primitive, with everything computed that no input has a part in.

Needs the package `onnx` (extra `export`). It knows the primitives of the policies. jax2onnx knows more, but its releases for
this jax ask for an orbax-checkpoint older than ours.
"""

import itertools
import string
from collections.abc import Callable
from typing import Any

import jax
import numpy as np
import onnx
from jax.extend import core
from onnx import helper, numpy_helper

OPSET, IR_VERSION = 17, 8  # of 2022: runtimes older than that are rare

Value = np.ndarray | str  # known, or the name of what a node gives


class OnnxError(ValueError):
    """A function has a primitive that is not known here."""


def to_onnx(function: Callable[[jax.Array], jax.Array], size: int, input_name: str, output_name: str) -> onnx.ModelProto:
    """The function of one float32 vector [size] as a model with one input and one output, each of fixed shape.

    Raises:
        OnnxError: a primitive has no translation, or the output does not depend on the input.
    """
    closed = jax.make_jaxpr(function)(jax.ShapeDtypeStruct((size,), np.float32))
    graph = _Graph()
    (result,) = graph.run(closed.jaxpr, closed.consts, [input_name])
    if not isinstance(result, str):
        raise OnnxError("the output does not depend on the input")
    graph.nodes.append(helper.make_node("Identity", [result], [output_name]))
    (aval,) = closed.out_avals
    ends = [
        helper.make_tensor_value_info(name, onnx.TensorProto.FLOAT, shape)
        for name, shape in ((input_name, (size,)), (output_name, aval.shape))
    ]
    body = helper.make_graph(graph.nodes, "policy", ends[:1], ends[1:], list(graph.initializers.values()))
    model = helper.make_model(body, opset_imports=[helper.make_opsetid("", OPSET)], ir_version=IR_VERSION)
    onnx.checker.check_model(model, full_check=True)
    return model


class _Graph:
    """Nodes and constants, as they come."""

    def __init__(self):
        self.nodes: list[onnx.NodeProto] = []
        self.initializers: dict[tuple, onnx.TensorProto] = {}
        self._numbers = itertools.count()

    def run(self, jaxpr: core.Jaxpr, consts: list, inputs: list[Value]) -> list[Value]:
        """Adds the nodes of a jaxpr; its outputs."""
        values: dict[Any, Value] = dict(zip(jaxpr.constvars, map(np.asarray, consts), strict=True))
        values |= dict(zip(jaxpr.invars, inputs, strict=True))

        def read(atom) -> Value:
            return np.asarray(atom.val, atom.aval.dtype) if isinstance(atom, core.Literal) else values[atom]

        for eqn in jaxpr.eqns:
            results = self._run_equation(eqn, [read(atom) for atom in eqn.invars])
            values |= dict(zip(eqn.outvars, results, strict=True))
        return [read(atom) for atom in jaxpr.outvars]

    def _run_equation(self, eqn: core.JaxprEqn, inputs: list[Value]) -> list[Value]:
        name = eqn.primitive.name
        if name in _CALLS:
            inner = eqn.params[_CALLS[name]]
            return self.run(inner.jaxpr, inner.consts, inputs)
        if not any(isinstance(value, str) for value in inputs):
            results = eqn.primitive.bind(*inputs, **eqn.params)
            return [np.asarray(result) for result in (results if eqn.primitive.multiple_results else [results])]
        names = [value if isinstance(value, str) else self.constant(value) for value in inputs]
        if name in _SAME:
            return [self.add(_SAME[name], *names)]
        if name not in _TRANSLATIONS:
            raise OnnxError(f"the JAX primitive {name} has no translation to ONNX")
        results = _TRANSLATIONS[name](self, eqn, *names)
        return [results] if isinstance(results, str) else list(results)

    def add(self, operator: str, *inputs: str, **attributes) -> str:
        """A node with one output; its name."""
        return self.add_many(operator, 1, *inputs, **attributes)[0]

    def add_many(self, operator: str, num_outputs: int, *inputs: str, **attributes) -> list[str]:
        names = [f"v{next(self._numbers)}" for _ in range(num_outputs)]
        self.nodes.append(helper.make_node(operator, inputs, names, **attributes))
        return names

    def constant(self, value) -> str:
        """The name of a constant, of which there is one for all that are equal."""
        value = np.asarray(value)
        key = (value.dtype.str, value.shape, value.tobytes())
        if key not in self.initializers:
            self.initializers[key] = numpy_helper.from_array(value, f"c{len(self.initializers)}")
        return self.initializers[key].name

    def reshape(self, name: str, shape) -> str:
        return self.add("Reshape", name, self.constant(np.asarray(shape, np.int64)))


# Primitives that call a jaxpr once, and the parameter that holds it.
_CALLS = {"jit": "jaxpr", "pjit": "jaxpr", "closed_call": "call_jaxpr", "custom_jvp_call": "call_jaxpr"}
# Primitives that ONNX has under another name.
_SAME = {
    "add": "Add",
    "sub": "Sub",
    "mul": "Mul",
    "div": "Div",
    "neg": "Neg",
    "max": "Max",
    "min": "Min",
    "sin": "Sin",
    "cos": "Cos",
    "exp": "Exp",
    "log": "Log",
    "sqrt": "Sqrt",
    "tanh": "Tanh",
    "asinh": "Asinh",
    "lt": "Less",
    "gt": "Greater",
    "stop_gradient": "Identity",
}


def _reshape(graph: _Graph, eqn, x: str) -> str:
    return graph.reshape(x, eqn.outvars[0].aval.shape)


def _broadcast(graph: _Graph, eqn, x: str) -> str:
    shape, places = eqn.params["shape"], eqn.params["broadcast_dimensions"]
    spread = np.ones(len(shape), np.int64)
    spread[list(places)] = eqn.invars[0].aval.shape
    return graph.add("Expand", graph.reshape(x, spread), graph.constant(np.asarray(shape, np.int64)))


def _slice(graph: _Graph, eqn, x: str) -> str:
    starts, ends = eqn.params["start_indices"], eqn.params["limit_indices"]
    steps = eqn.params["strides"] or (1,) * len(starts)
    bounds = (starts, ends, range(len(starts)), steps)
    return graph.add("Slice", x, *(graph.constant(np.asarray(list(values), np.int64)) for values in bounds))


def _split(graph: _Graph, eqn, x: str) -> list[str]:
    sizes = np.asarray(eqn.params["sizes"], np.int64)
    return graph.add_many("Split", len(sizes), x, graph.constant(sizes), axis=eqn.params["axis"])


def _pad(graph: _Graph, eqn, x: str, fill: str) -> str:
    low, high, between = np.asarray(eqn.params["padding_config"], np.int64).T
    if between.any() or min(*low, *high) < 0:
        raise OnnxError("padding between entries, or below 0, has no translation to ONNX")
    return graph.add("Pad", x, graph.constant(np.concatenate([low, high])), fill)


def _concatenate(graph: _Graph, eqn, *parts: str) -> str:
    return graph.add("Concat", *parts, axis=eqn.params["dimension"])


def _stack(graph: _Graph, eqn, *parts: str) -> str:
    axis = eqn.params["axis"]
    shape = list(eqn.outvars[0].aval.shape)
    shape[axis] = 1
    return graph.add("Concat", *(graph.reshape(part, shape) for part in parts), axis=axis)


def _transpose(graph: _Graph, eqn, x: str) -> str:
    return graph.add("Transpose", x, perm=list(eqn.params["permutation"]))


def _convert(graph: _Graph, eqn, x: str) -> str:
    return graph.add("Cast", x, to=helper.np_dtype_to_tensor_dtype(np.dtype(eqn.params["new_dtype"])))


def _select(graph: _Graph, eqn, which: str, on_false: str, on_true: str) -> str:
    return graph.add("Where", which, on_true, on_false)


def _sum(graph: _Graph, eqn, x: str) -> str:
    return graph.add("ReduceSum", x, graph.constant(np.asarray(eqn.params["axes"], np.int64)), keepdims=0)


def _power(graph: _Graph, eqn, x: str) -> str:
    return graph.add("Pow", x, graph.constant(np.float32(eqn.params["y"])))


def _square(graph: _Graph, eqn, x: str) -> str:
    return graph.add("Mul", x, x)


def _rsqrt(graph: _Graph, eqn, x: str) -> str:
    return graph.add("Reciprocal", graph.add("Sqrt", x))


def _expm1(graph: _Graph, eqn, x: str) -> str:
    return graph.add("Sub", graph.add("Exp", x), graph.constant(np.float32(1.0)))


def _dot(graph: _Graph, eqn, left: str, right: str) -> str:
    """Any product of two arrays, as the sum that it is."""
    (left_summed, right_summed), (left_batch, right_batch) = eqn.params["dimension_numbers"]
    letters = iter(string.ascii_letters)
    a, b = ([next(letters) for _ in atom.aval.shape] for atom in eqn.invars)
    for i, j in zip((*left_summed, *left_batch), (*right_summed, *right_batch), strict=True):
        b[j] = a[i]
    batch = [a[i] for i in left_batch]
    free = [letter for letter in (*a, *b) if (letter in a) != (letter in b)]
    return graph.add("Einsum", left, right, equation=f"{''.join(a)},{''.join(b)}->{''.join(batch + free)}")


_TRANSLATIONS: dict[str, Callable[..., str | list[str]]] = {
    "broadcast_in_dim": _broadcast,
    "concatenate": _concatenate,
    "convert_element_type": _convert,
    "dot_general": _dot,
    "expm1": _expm1,
    "integer_pow": _power,
    "pad": _pad,
    "reduce_sum": _sum,
    "reshape": _reshape,
    "rsqrt": _rsqrt,
    "select_n": _select,
    "slice": _slice,
    "split": _split,
    "square": _square,
    "squeeze": _reshape,
    "stack": _stack,
    "transpose": _transpose,
}
