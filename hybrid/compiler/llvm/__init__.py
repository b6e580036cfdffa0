"""Translation of the code of functions to LLVM's instructions and to machine code."""
