#pragma once

/// Namespace of everything that is compiled once per instruction set (docs/design/0004): two builds of one body must
/// never share a symbol, or the linker could hand AVX-512 code to a CPU without it.
#ifndef STICTION_ISA
#define STICTION_ISA isa_baseline
#endif
