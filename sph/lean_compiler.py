"""Numba's compiler without the passes that compiled code here does not need."""

import inspect

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
