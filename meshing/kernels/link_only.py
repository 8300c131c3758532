"""Compilation of functions that only kernels call: no machine code of their own.

numba emits the machine code of each function with all that it calls, at every level of calls, though
only the code of the kernel that calls them all is run. Without that, kernels compile in 0.65 to 0.9 of
the time, and run as fast.
"""

from typing import Any

from numba import _dynfunc  # type: ignore[attr-defined]
from numba.core import codegen, compiler, compiler_machinery, typed_passes


class _LinkedLibrary(codegen.JITCodeLibrary):
    """Code that is optimised, and linked into that of its callers."""

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
        kept, flags.no_compile = flags.no_compile, True
        super().run_pass(state)
        flags.no_compile = kept
        lowered, library = state["cr"], state.library
        # What numba finds the function by.
        entry = _dynfunc.make_function(
            lowered.fndesc.lookup_module(), lowered.fndesc.qualname.split(".")[-1], "", 0,
            lowered.env, (library,),
        )  # fmt: skip
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
