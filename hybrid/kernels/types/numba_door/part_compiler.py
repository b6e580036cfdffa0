"""Numba's compiler, with only the work that kernels need.

Numba optimises every function by itself and makes machine code of it, before it links the function into its
callers and optimises it there again. Nobody calls the machine code of a part, and what is optimised in the
caller need not be before, with few exceptions. So a part is not even linked with what it calls.

Most of numba's time goes into its own Python. Kernels contain no closures, no branches on types, no array
expressions and no references to count, so many of its passes change nothing. What it finds out about a call
or a type, it finds out again in every function; here it is remembered.
"""

from typing import Any

from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import CompilerBase, DefaultPassBuilder
from numba.core.compiler_machinery import register_pass
from numba.core.typed_passes import NativeLowering

from hybrid.kernels.types.numba_door.lowering import KernelLowering

# What every step of a run and its tangent vectors go through. Optimised by itself as well, it comes out a few
# parts in a hundred faster.
THOROUGHLY = (
    "hybrid.kernels.arithmetic.tangent",
    "hybrid.kernels.steps.series",
    "hybrid.kernels.guards.first_event",
    "hybrid.kernels.steps.series_length",
    "hybrid.kernels.guards.isolate",
    "hybrid.kernels.guards.form",
    "hybrid.kernels.guards.roots",
)
# Numba's passes that change nothing in a kernel. The legalisation marks where variables end, which only
# references need.
NEEDLESS = {
    "WithLifting",
    "InlineClosureLikes",
    "RewriteSemanticConstants",
    "DeadBranchPrune",
    "RewriteDynamicRaises",
    "MakeFunctionToJitFunction",
    "InlineInlinables",
    "FindLiterallyCalls",
    "LiteralUnroll",
    "LiteralPropagationSubPipelinePass",
    "InlineOverloads",
    "NopythonRewrites",
    "NoPythonSupportedFeatureValidation",
    "IRLegalization",
    "AnnotateTypes",
    "DumpParforDiagnostics",
}


class WholeLibrary(JITCodeLibrary):
    """A library that all parts are linked into, at once."""

    def finalize(self):
        """Link, then optimise."""
        _link_needed(self, self._final_module)
        # Nothing is left for numba to link.
        self._linking_libraries = []
        super().finalize()

    def _optimize_final_module(self):
        # Numba itself does so twice, for the sake of reference counts, which kernels do not have.
        passes, builder = self._codegen._module_pass_manager()
        passes.run(self._final_module, builder)

    def _finalize_final_module(self):
        self._finalized = True


def _needed(library, needed, seen):
    """The libraries that a library calls, directly or not, each behind those that it calls itself.

    They are linked from the last one to the first: LLVM leaves out what nothing calls yet.
    """
    for each in library._linking_libraries:
        if each not in seen:
            seen.add(each)
            if isinstance(each, _PartLibrary):
                _needed(each, needed, seen)
            needed.append(each)
    return needed


def _link_needed(library, module):
    """Link all that a library calls into a module."""
    for each in reversed(_needed(library, [], set())):
        alone = each.alone() if isinstance(each, _PartLibrary) else each._get_module_for_linking()
        module.link_in(alone, preserve=True)


class _NoEnvironment:
    """Takes the place of a code generator where there is no machine code to give an environment to."""

    def set_env(self, name, environment):
        """Nothing to set."""


class _WithoutCode(JITCodeLibrary):
    """A library that no machine code is made of."""

    codegen = _NoEnvironment()

    def _optimize_functions(self, ll_module):
        """As numba's own, which also makes passes for each function that is only declared."""
        ll_module.data_layout = self._codegen._data_layout
        passes, builder = self._codegen._function_pass_manager()
        for function in ll_module.functions:
            if not function.is_declaration:
                passes.run(function, builder)

    def get_pointer_to_function(self, name):
        """Null, as for any name that a library does not define."""
        self._ensure_finalized()
        return 0


class _PartLibrary(_WithoutCode):
    """A library to be linked into others as it was lowered."""

    def finalize(self):
        """Leave the linking to those who use this part."""
        self._finalized = True

    def alone(self):
        """The module of this part, without what it calls."""
        return super()._get_module_for_linking()

    def _get_module_for_linking(self):
        # For functions that numba compiles as usual.
        module = self.alone().clone()
        _link_needed(self, module)
        return module


class _OptimisedPart(_WithoutCode, WholeLibrary):
    """A library that is optimised with all that it calls before it is linked into others."""


@register_pass(mutates_CFG=True, analysis_only=False)
class _PartLowering(NativeLowering):
    """Numba's lowering, into a library for parts."""

    _name = "part_lowering"
    lowering_class = KernelLowering

    def run_pass(self, state):
        """Choose the library before numba would make the usual one."""
        name = state.func_id.func_qualname
        library = _OptimisedPart if state.func_id.modname in THOROUGHLY else _PartLibrary
        state.library = library(state.targetctx.codegen(), name)
        state.library.enable_object_caching()
        return super().run_pass(state)


class _Remembering:
    """Numba's typing context, which remembers the signatures of calls.

    Numba works out the signature of every call anew, and tries dozens of candidates for each operator.
    """

    def __init__(self, context, signatures):
        self._context, self._signatures = context, signatures

    def __getattr__(self, name):
        return getattr(self._context, name)

    def resolve_function_type(self, function, arguments, keywords):
        """The signature of a call with arguments of these types."""
        key = function, tuple(arguments), tuple(keywords.items())
        signature = self._signatures.get(key)
        if signature is None:
            signature = self._context.resolve_function_type(function, arguments, keywords)
            self._signatures[key] = signature
        return signature


# What has been found for all kernels: signatures of calls, and sizes of types in memory by their text.
_SIGNATURES: dict[Any, Any] = {}
_SIZES: dict[str, int] = {}


class PartCompiler(CompilerBase):
    """Numba's passes, of which the last writes into a library for parts; ``njit(pipeline_class=...)``."""

    def __init__(self, typingctx, *others):
        remembering = _Remembering(typingctx, _SIGNATURES)
        super().__init__(remembering, *others)
        context, size_of = self.state.targetctx, self.state.targetctx.get_abi_sizeof

        def remembered_size(kind):
            text = str(kind)
            if text not in _SIZES:
                _SIZES[text] = size_of(kind)
            return _SIZES[text]

        context.typing_context = remembering
        # Numba has LLVM read a module to measure a type.
        context.get_abi_sizeof = remembered_size

    def define_pipelines(self):
        """The one pipeline."""
        pipeline = DefaultPassBuilder.define_nopython_pipeline(self.state)
        pipeline.passes[:] = [
            (_PartLowering if each is NativeLowering else each, purpose)
            for each, purpose in pipeline.passes
            if each.__name__ not in NEEDLESS
        ]
        pipeline.finalize()
        return [pipeline]
