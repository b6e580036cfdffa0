"""How numba compiles kernels: no further than to intermediate code.

Numba optimises every function by itself and makes machine code of it, before it links the function into its
callers and optimises it there again. Nobody calls the machine code of a part, and what is optimised in the
caller need not be before, with few exceptions: both together are a third of the time that all kernels take.
``export`` makes machine code of the kernels that Python calls or hands to other kernels.
"""

from numba import njit
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import CompilerBase, DefaultPassBuilder
from numba.core.compiler_machinery import LoweringPass, register_pass
from numba.core.typed_passes import NativeLowering

import hybrid.kernels.types.numba_types  # noqa: F401 (so that kernels may take structures)

# What every step of a run and its tangent vectors go through. Optimised by itself as well, it comes out a few
# parts in a hundred faster.
THOROUGHLY = (
    "hybrid.kernels.arithmetic.tangent",
    "hybrid.kernels.steps.series",
    "hybrid.kernels.steps.series_guards",
)


def optimise(library):
    """Optimise the module of a library once.

    Numba itself does so twice, for the sake of reference counts, which kernels do not have.
    """
    passes, builder = library._codegen._module_pass_manager()
    passes.run(library._final_module, builder)


class _NoEnvironment:
    """Takes the place of a code generator where there is no machine code to give an environment to."""

    def set_env(self, name, environment):
        """Nothing to set."""


class _PartLibrary(JITCodeLibrary):
    """A library to be linked into others as it was lowered."""

    codegen = _NoEnvironment()
    thoroughly = False

    def _optimize_final_module(self):
        if self.thoroughly:
            optimise(self)

    def _finalize_final_module(self):
        self._finalize_dynamic_globals()
        self._verify_declare_only_symbols()
        self._finalized = True

    def get_pointer_to_function(self, name):
        """Null, as for any name that a library does not define."""
        self._ensure_finalized()
        return 0


@register_pass(mutates_CFG=False, analysis_only=False)
class _PartLowering(LoweringPass):
    """Choose the library before numba's lowering would make the usual one."""

    _name = "part_lowering"

    def __init__(self):
        super().__init__()

    def run_pass(self, state):
        """The function itself stays as it is, which is the answer."""
        state.library = _PartLibrary(state.targetctx.codegen(), state.func_id.func_qualname)
        state.library.thoroughly = state.func_id.modname in THOROUGHLY
        state.library.enable_object_caching()
        return False


class PartCompiler(CompilerBase):
    """Numba's passes, of which the last writes into a library for parts; ``njit(pipeline_class=...)``."""

    def define_pipelines(self):
        """The one pipeline."""
        pipeline = DefaultPassBuilder.define_nopython_pipeline(self.state)
        place = [each for each, _ in pipeline.passes].index(NativeLowering)
        pipeline.passes.insert(place, (_PartLowering, "choose the library of a part"))
        pipeline.finalize()
        return [pipeline]


# Sums may be reordered and fused, but nan and infinity keep their meaning in comparisons (``math.isfinite``
# takes the difference of a number and itself, which may be taken for zero). Kernels allocate nothing and own
# nothing, so no references are counted.
KERNEL = {
    "error_model": "numpy",
    "fastmath": {"contract", "reassoc", "nsz"},
    "_nrt": False,
    "no_cpython_wrapper": True,
    "no_cfunc_wrapper": True,
    "pipeline_class": PartCompiler,
}
# Small and called at every stage: the call would cost as much as the work.
INLINE = KERNEL | {"forceinline": True}


def exported(result, *arguments):
    """Decorate a kernel that Python calls or hands to other kernels; the kinds are those of its signature.

    For other kernels it is a function like any other, which becomes part of them.
    """

    def declare(function):
        kernel = njit(**KERNEL)(function)
        kernel.exported = result, arguments
        return kernel

    return declare
