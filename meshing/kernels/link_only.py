"""Compilation of functions that only kernels call: no machine code of their own.

numba optimises each function with all that it calls, and emits its machine code, at every level of
calls, though only the code of the kernel that calls them all is run. Without machine code in between,
kernels compile in 0.65 to 0.9 of the time, without optimisation in between in 0.9 of what is left, and
they run as fast.
"""

from typing import Any

import llvmlite.binding as llvm
from numba import _dynfunc  # type: ignore[attr-defined]
from numba.core import caching, codegen, compiler, compiler_machinery, typed_passes

# Set on a Python function: its code is called, never inlined.
OUTLINED = "_is_outlined"


class _LinkedLibrary(codegen.JITCodeLibrary):
    """Code that is linked into that of its callers, and optimised there."""

    is_outlined = False

    def add_ir_module(self, ir_module: Any) -> None:
        """Add the code of the function, before it is optimised."""
        if self.is_outlined:
            for function in ir_module.functions:
                # The other functions in it are numba's own helpers.
                if not function.is_declaration and "alwaysinline" not in function.attributes:
                    function.attributes.add("noinline")
        super().add_ir_module(ir_module)

    def _optimize_final_module(self) -> None:
        """Leave that to the kernel: its code is optimised as a whole."""

    def _finalize_final_module(self) -> None:
        self._finalize_dynamic_globals()
        self._verify_declare_only_symbols()
        self._finalized = True


@compiler_machinery.register_pass(mutates_CFG=True, analysis_only=False)
class _LoweringToLink(typed_passes.NativeLowering):
    """Lowering to code that callers link, with an entry that cannot be called."""

    _name = "lowering_to_link"

    def run_pass(self, state: Any) -> bool:
        """Run the pass."""
        target, flags = state.targetctx, state.flags
        state.library = _LinkedLibrary(target.codegen(), state.func_id.func_qualname)
        state.library.is_outlined = hasattr(state.func_id.func, OUTLINED)
        kept, flags.no_compile = flags.no_compile, True
        super().run_pass(state)
        flags.no_compile = kept
        lowered, library = state["cr"], state.library
        entry = _entry(lowered.fndesc, lowered.env, library)
        target.insert_user_function(entry, lowered.fndesc, [library])
        state.reload_init.extend(library._reload_init)
        state["cr"] = lowered._replace(cfunc=entry)
        return True


class LinkOnly(compiler.CompilerBase):
    """The passes of numba, but for that one."""

    def define_pipelines(self) -> list[Any]:
        """Return the only pipeline: Python objects are not fallen back on."""
        passes = compiler.DefaultPassBuilder.define_nopython_pipeline(self.state)
        passes.passes = [
            (_LoweringToLink, why) if which is typed_passes.NativeLowering else (which, why)
            for which, why in passes.passes
        ]
        passes.finalize()
        return [passes]


class CacheOfLinked(caching.CompileResultCacheImpl):
    """What the cache holds of such a function: its code before it is made machine code."""

    def reduce(self, cres: Any) -> Any:
        """Return what can be pickled of a compiled function."""
        description = cres.fndesc
        description.typemap = description.calltypes = None  # not needed, and may not be pickled
        code = cres.library._get_module_for_linking().as_bitcode()
        return (
            cres.library.name, code, description, cres.environment, cres.signature, cres.reload_init,
        )  # fmt: skip

    def rebuild(self, target_context: Any, payload: Any) -> Any:
        """Return the compiled function."""
        name, code, description, environment, signature, reload_init = payload
        for function in reload_init:
            function()
        library = _LinkedLibrary(target_context.codegen(), name)
        library._final_module = library._shared_module = llvm.parse_bitcode(code)
        library._finalized = True
        return compiler.compile_result(
            target_context=target_context,
            typing_context=target_context.typing_context,
            library=library,
            environment=environment,
            entry_point=_entry(description, environment, library),
            fndesc=description,
            signature=signature,
            objectmode=False,
            lifted=(),
            reload_init=reload_init,
        )


def _entry(description: Any, environment: Any, library: Any) -> Any:
    """Return what numba finds a function by; it cannot be called."""
    name = description.qualname.split(".")[-1]
    return _dynfunc.make_function(description.lookup_module(), name, "", 0, environment, (library,))
