"""Numba's compiler without the passes that compiled code here does not need."""

import inspect
from typing import Any

from numba.core import codegen, environment
from numba.core.compiler import CompilerBase, DefaultPassBuilder

# Names of the passes that are left out: they do nothing to code without array expressions, other
# functions inside, `with`, and Numba's `literally` and `literal_unroll`. Each costs an analysis of
# the whole function, in all a tenth of the time that compilation takes.
UNUSED = {
    "WithLifting", "InlineClosureLikes", "MakeFunctionToJitFunction", "InlineInlinables",
    "FindLiterallyCalls", "LiteralUnroll", "LiteralPropagationSubPipelinePass", "InlineOverloads",
    "NopythonRewrites", "AnnotateTypes", "DumpParforDiagnostics",
}  # fmt: skip


class Lean(CompilerBase):
    """The compiler of functions with the options `sph.compiled.COMPILED` or `INLINED`.

    A function that has others inside, such as a comprehension, gets all passes.
    """

    def define_pipelines(self):
        passes = DefaultPassBuilder.define_nopython_pipeline(self.state)
        constants = self.state.func_id.func.__code__.co_consts
        if not any(map(inspect.iscode, constants)):
            passes.passes = [one for one in passes.passes if one[0].__name__ not in UNUSED]
        return [passes]


class Library(codegen.JITCodeLibrary):
    """The code of a function, translated to the machine's only if Python calls the function.

    Numba translates every function before it links the function into others. Functions that only
    compiled code calls are then translated in vain, and the translation leaves changes for this
    processor in the code that is linked into their callers.
    """

    _is_translated = False

    def get_pointer_to_function(self, name):
        self._ensure_finalized()
        if any(one.name == name and not one.is_declaration for one in self._final_module.functions):
            self._translate()
        return super().get_pointer_to_function(name)

    def _optimize_functions(self, ll_module):
        ll_module.data_layout = self._codegen._data_layout
        passes, builder = self._codegen._function_pass_manager()
        for function in ll_module.functions:
            if not function.is_declaration:
                passes.run(function, builder)

    def _finalize_specific(self):
        if self._disable_inspection:  # machine code, from the cache
            self._translate()

    def _get_compiled_object(self):
        self._translate()
        return super()._get_compiled_object()

    def _translate(self):
        if not self._is_translated:
            self._is_translated = True
            self._codegen._engine.add_module(self._final_module)
            super()._finalize_specific()
            self._set_environments()

    def _set_environments(self):
        """Set the addresses of the constants of functions that are linked into this one."""
        for variable in self._final_module.global_variables:
            found = environment.lookup_environment(variable.name)
            if found is not None and not variable.is_declaration:
                engine: Any = self._codegen
                engine.set_env(variable.name, found)


def install() -> None:
    """Make Numba's functions have libraries of this kind, which add themselves to the engine."""
    of_process: Any = codegen.JITCPUCodegen
    set_env = of_process.set_env

    def set_if_translated(self, name, found):
        if self._engine.is_symbol_defined(name):
            set_env(self, name, found)

    of_process._library_class = Library
    of_process._add_module = lambda self, module: None
    of_process.set_env = set_if_translated
