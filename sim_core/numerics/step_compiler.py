"""Compiler of functions that only other compiled functions call: it makes no machine code.

numba links the code of a called function, in LLVM's language, into each caller, and makes machine
code of both. Nobody runs the machine code of the called function.
"""

from collections.abc import Callable

import llvmlite.binding as llvm
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import Compiler


class _LinkedLibrary(JITCodeLibrary):
    """Code of one function, optimised, for linking into its callers."""

    def _finalize_final_module(self) -> None:
        # numba does not cache code with addresses of this process in it
        self._finalize_dynamic_globals()
        self._verify_declare_only_symbols()
        self._finalized = True
        self._get_module_for_linking()
        self._finalized = False
        # what runs has no function, only the place for numba's pointer to the Python function
        places = [
            f"@{one.name} = common global i8* null"
            for one in self._final_module.global_variables
            if "NumbaEnv" in one.name
        ]
        empty = self._codegen._create_empty_module(self.name)
        self._final_module = llvm.parse_assembly("\n".join([str(empty), *places]))
        self._final_module.name = self.name
        super()._finalize_final_module()


class StepCompiler(Compiler):
    """numba's compiler, without machine code."""

    def compile_extra(self, function: Callable[..., object]) -> object:
        codegen = self.state.targetctx.codegen()
        self.state.library = _LinkedLibrary(codegen, function.__qualname__)
        self.state.library.enable_object_caching()
        return super().compile_extra(function)
