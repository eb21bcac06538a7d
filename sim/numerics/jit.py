"""Compilation by numba, the only place that decorates with it.

There are four decorators. ``device`` is for a helper that compiles into its callers. ``inlined`` is for a helper whose
body must be part of the calling loop (Philox words for single bonds: a tenth of their time). ``kernel`` is for a loop
over arrays. ``law`` is for a formula that broadcasts as a numpy ufunc but keeps its Python signature, defaults and
docstring. Kernels and laws compile at their first call. Their machine code is kept on disk, one file each, in a folder
named by a hash of all compiled sources. It is loaded without numba's type tables, because their setup takes half a
second. A cache that is broken, read-only or full costs time, never a run.

Loading in this way needs some internals of numba. If a version of numba lacks one of them, ``FAST`` is false: the
decorators are then numba's public ones with numba's own cache, in the same folder. The numbers are the same.
"""

import contextlib
import functools
import hashlib
import inspect
import pickle
import re
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import llvmlite
import numba
import numpy as np
from llvmlite import binding, ir
from numba.extending import intrinsic

from sim.numerics import disk_cache

#: Floats divide as numpy divides them; no wrapper is made for calls from C, which nobody makes.
_OPTIONS: dict[str, Any] = {"error_model": "numpy", "no_cfunc_wrapper": True}


try:
    from numba.core.compiler import CompileResult
    from numba.core.compiler_lock import global_compiler_lock
    from numba.core.registry import CPUDispatcher, cpu_target
    from numba.core.runtime import _nrt_python  # type: ignore[attr-defined]
    from numba.core.serialize import dumps
    from numba.np.ufunc import _internal  # type: ignore[attr-defined]
    from numba.np.ufunc.ufuncbuilder import UFuncDispatcher
    from numba.np.ufunc.wrappers import build_ufunc_wrapper

    FAST = True
except ImportError:
    FAST, CPUDispatcher = False, object  # type: ignore[misc,assignment]


class _Device(CPUDispatcher):
    """A compiled function without the wrappers that Python calls, which are a tenth of what a first run compiles."""

    @functools.cached_property
    def _from_python(self) -> Callable:
        return numba.njit(error_model="numpy")(self.py_func)

    def __call__(self, *arguments: Any) -> Any:
        return self._from_python(*arguments)


def device(function: Callable, inline: Any = "never") -> Callable:
    """Compile a helper into its callers."""
    if not FAST:
        return numba.njit(error_model="numpy", inline=inline)(function)
    options = {"nopython": True, "no_cpython_wrapper": True, "inline": inline}
    return _Device(function, targetoptions=_OPTIONS | options)


inlined = functools.partial(device, inline="always")


@intrinsic
def float_of(typing: Any, bits: Any) -> Any:
    """The float that has the bits of a whole number of 64."""
    return numba.float64(bits), _cast


@intrinsic
def bits_of(typing: Any, number: Any) -> Any:
    """The bits of a float as a whole number."""
    return numba.int64(numba.float64), _cast


def _cast(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
    return builder.bitcast(arguments[0], context.get_value_type(signature.return_type))


@intrinsic
def apart(typing: Any) -> Any:
    """Keep the helper that calls this out of the code of its callers.

    A long helper that is seldom called would make a loop slower that hardly ever calls it.
    """
    return numba.types.none(), _apart


def _apart(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
    builder.function.attributes.add("noinline")
    return context.get_dummy_value()


@intrinsic
def float_at(typing: Any, address: Any, place: Any) -> Any:
    """The float at a place of an array whose address is a whole number in a float.

    An array among the numbers of a law would have its references counted in each helper.
    """
    return numba.float64(numba.float64, numba.int64), _loaded


def _loaded(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
    word, double = ir.IntType(64), ir.DoubleType()
    first, place = builder.fptoui(arguments[0], word), arguments[1]
    place = builder.add(first, builder.mul(place, ir.Constant(word, 8)))
    return builder.load(builder.inttoptr(place, double.as_pointer()))


@intrinsic
def borrowed(typing: Any, arrays: Any) -> Any:
    """An array, or a tuple of arrays, whose references are not counted because the caller holds the array.

    To count the references of the arguments of a short helper takes longer than the helper.
    """
    return arrays(arrays), _without_owner


def _without_owner(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
    kind, value = signature.return_type, arguments[0]
    if isinstance(kind, numba.types.Array):
        array = context.make_array(kind)(context, builder, value)
        array.meminfo = array.meminfo.type(None)
        return array._getvalue()
    for place, inner in enumerate(getattr(kind, "types", ())):
        part = _without_owner(
            context, builder, inner(inner), (builder.extract_value(value, place),)
        )
        value = builder.insert_value(value, part, place)
    return value


#: Every kernel and law that was imported, by its name in the cache; calling one compiles or loads it.
compiled: dict[str, Callable[[], Callable]] = {}
#: Called with the name of each kernel or law that is about to be compiled, as it is not in the cache.
on_compiling: list[Callable[[str], None]] = []
_BLOCK = 4096


@functools.cache
def sources() -> dict[str, bytes]:
    """Texts of the modules that import this one and of those that they import, whose constants are compiled in."""
    texts = disk_cache.sources()
    users = [name for name, text in texts.items() if b"sim.numerics.jit" in text]
    imported = {
        word.decode()
        for name in users
        for word in re.findall(rb"^from (sim[\w.]*) import", texts[name], re.M)
    }
    return {name: texts[name] for name in sorted({*users, *imported} & texts.keys())}


@functools.cache
def _cache_folder() -> str:
    """Folder of compiled code, named by a hash of versions and of all sources that import this module."""
    digest = hashlib.sha256(
        f"{sys.version} {numba.__version__} {llvmlite.__version__} {np.__version__}".encode()
    )
    for text in (Path(__file__).read_bytes(), *sources().values()):
        digest.update(text)
    return str(disk_cache.folder() / digest.hexdigest()[:16])


def machine() -> str:
    """The processor as compiled code and numpy use it."""
    vectors = np._core._multiarray_umath.__cpu_features__  # type: ignore[attr-defined]
    features = binding.get_host_cpu_features().flatten()
    processor = binding.get_process_triple(), binding.get_host_cpu_name(), features
    chosen = [
        getattr(numba.config, name)
        for name in ("CPU_NAME", "CPU_FEATURES", "ENABLE_AVX")
    ]
    return repr((processor, chosen, np.__version__, vectors))


def _path(name: str) -> Path:
    """File of a kernel or law in the cache, which also names the machine that the code is for."""
    return Path(
        _cache_folder(), f"{name}.{hashlib.sha256(machine().encode()).hexdigest()[:8]}"
    )


def cached(name: str) -> bool:
    """True if the cache holds the code of a kernel or law."""
    if not FAST:
        return any(Path(_cache_folder()).rglob(f"*{name.rpartition('.')[2]}-*.nbi"))
    return disk_cache.read(_path(name)) is not None


@functools.cache
def _add_symbols() -> None:
    """Give the linker what cached code calls of numba's memory: the part of its set-up that needs no compiler."""
    for name, address in _nrt_python.c_helpers.items():
        binding.add_symbol(name if name.startswith("_") else f"NRT_{name}", address)


def _built(
    function: Callable,
    make: Callable[[], tuple[Callable, Any]],
    load: Callable[..., Callable],
) -> Callable:
    """Load the code of a function from the cache; compile the function by ``make`` if loading fails in any way.

    Unpickling and rebuilding raise whatever they meet (EOFError, UnpicklingError, AttributeError, ...), so every
    exception leads to compilation, where a fault of the function itself shows again.
    """
    with global_compiler_lock:
        _add_symbols()
        path = _path(_name(function))
        with contextlib.suppress(Exception):
            return load(*pickle.loads(disk_cache.read(path) or b""))
        for notice in on_compiling:
            notice(_name(function))
        result, code = make()
        with contextlib.suppress(Exception):
            disk_cache.store(path, dumps(code()))
        return result


def _public(decorator: Callable[..., Callable], function: Callable) -> Callable:
    """Compile a function by a public decorator of numba, cached in the folder of these sources if that is possible."""
    for notice in on_compiling if not cached(_name(function)) else ():
        notice(_name(function))
    try:
        Path(_cache_folder()).mkdir(parents=True, exist_ok=True)
        setattr(numba.config, "CACHE_DIR", _cache_folder())  # noqa: B010  read as the function is decorated
        return decorator(cache=True)(function)
    except (OSError, RuntimeError):  # no place for a cache
        return decorator()(function)


def _name(function: Callable) -> str:
    return f"{function.__module__}.{function.__qualname__}"


def _at_first_call(
    function: Callable, public: Callable[..., Callable], make: Callable, load: Callable
) -> Callable:
    """Return the function that compiles or loads another one when it is first called, and list it in ``compiled``."""

    @functools.cache
    def built() -> Callable:
        return _built(function, make, load) if FAST else _public(public, function)

    compiled[_name(function)] = built
    return built


def kernel(signature: str) -> Callable[[Callable], Callable]:
    """Compile a loop over arrays for one ``signature``, at the first call."""

    def decorate(function: Callable) -> Callable:
        def make() -> tuple[Callable, Callable]:
            dispatcher = numba.njit(signature, **_OPTIONS)(function)
            return dispatcher, lambda: without_numba(
                *next(iter(dispatcher.overloads.values()))._reduce()
            )

        def without_numba(*parts: Any) -> Any:
            """Leave out names that only messages of numba's own functions use; to import them takes 50 ms."""
            return *parts[:-1], [
                names
                for names in parts[-1]
                if not names.globals["__name__"].startswith("numba.")
            ]

        def load(*code: Any) -> Callable:
            dispatcher = numba.njit(**_OPTIONS)(function)
            dispatcher.add_overload(
                CompileResult._rebuild(cpu_target.target_context, *code)
            )
            dispatcher.disable_compile()
            return dispatcher

        built = _at_first_call(
            function,
            functools.partial(numba.njit, signature, error_model="numpy"),
            make,
            load,
        )

        @functools.wraps(function)
        def call(*arguments):
            return built()(*arguments)

        return call

    return decorate


def law(function: Callable) -> Callable:
    """Turn a scalar formula of floats into one that broadcasts over arrays.

    The result keeps name, signature, defaults and docstring; where no answer exists it gives nan
    without a warning.
    """
    declared = inspect.signature(function)
    count = len(declared.parameters)
    signature = f"float64({', '.join(['float64'] * count)})"

    def ufunc_of(library: Any, name: str) -> Callable:
        pointer, doubles = (
            library.get_pointer_to_function(name),
            [np.dtype(float).num] * (count + 1),
        )
        labels = function.__name__, function.__doc__
        return _internal.fromfunc(
            *labels,
            [pointer],
            [doubles],
            count,
            1,
            [None],
            [library],
            _internal.PyUFunc_None,
        )

    def make() -> tuple[Callable, Callable]:
        result = UFuncDispatcher(function, targetoptions={"nopython": True}).compile(
            signature
        )
        inner = (
            result.library,
            result.target_context,
            result.fndesc.llvm_func_name,
            result.signature,
        )
        library, _, name = build_ufunc_wrapper(*inner, False, result)
        library.enable_object_caching()
        return ufunc_of(library, name), lambda: (
            library.serialize_using_object_code(),
            name,
        )

    def load(code: Any, name: str) -> Callable:
        return ufunc_of(
            cpu_target.target_context.codegen().unserialize_library(code), name
        )

    built = _at_first_call(
        function,
        functools.partial(numba.vectorize, [signature], nopython=True),
        make,
        load,
    )

    @functools.wraps(function)
    def call(*arguments, **keywords):
        if keywords or len(arguments) != count:
            bound = declared.bind(*arguments, **keywords)
            bound.apply_defaults()
            arguments = bound.args
        small = all(map(_is_small, arguments))
        with np.errstate(all="ignore"):
            return built()(*arguments) if small else _in_blocks(built(), arguments)

    return call


def _is_small(argument: Any) -> bool:
    return type(argument) is float or (
        type(argument) is np.ndarray and argument.size < _BLOCK // 16
    )


@functools.lru_cache(maxsize=64)  # constants of a scene come back at every step
def _filled(shape: tuple[int, ...], value: float) -> np.ndarray:
    """Read-only array of one number."""
    array = np.full(shape, value)
    array.flags.writeable = False
    return array


def _in_blocks(ufunc: Callable, arguments: tuple) -> Any:
    """Call a ufunc; with large arrays beside single numbers in blocks in which the numbers are arrays, too.

    The compiler's vector instructions need every argument contiguous; a block that stays in the
    cache makes that free. Elementwise, so the blocks change no bit.
    """
    arrays = [np.asarray(argument, dtype=float) for argument in arguments]
    size = max([array.size for array in arrays])
    if size < _BLOCK // 16:
        return ufunc(*arrays)
    shapes = [array.shape for array in arrays if array.size != 1]
    shape = shapes[0]
    if shapes.count(shape) != len(shapes):
        return ufunc(*arrays)
    if size <= _BLOCK:
        return ufunc(
            *[
                _filled(shape, array.item()) if array.size == 1 else array
                for array in arrays
            ]
        )
    flat = [
        _filled((_BLOCK,), a.item()) if a.size == 1 else np.ascontiguousarray(a).ravel()
        for a in arrays
    ]
    out = np.empty(size)
    for first in range(0, size, _BLOCK):
        block = slice(first, min(first + _BLOCK, size))
        length = block.stop - first
        ufunc(
            *[
                a[:length] if array.size == 1 else a[block]
                for a, array in zip(flat, arrays, strict=True)
            ],
            out[block],
        )
    return out.reshape(shape)
