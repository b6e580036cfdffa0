"""Translation of generated statements to LLVM's text and to machine code."""
