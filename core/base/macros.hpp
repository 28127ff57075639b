#pragma once

/// Namespace of everything that is compiled once per instruction set (docs/explanation/design/0004). Two builds of one
/// text must never share a symbol, or the linker could hand AVX2 code to a CPU without it.
#ifndef STICTION_ISA
#define STICTION_ISA isa_baseline
#endif

/// Stands before a loop whose bound is a constant. On the device its body is repeated, so that every index in it is a
/// constant and the arrays it reads can be registers. Host compilers need no such promise.
#if defined(__CUDA_ARCH__)
#define STICTION_UNROLL _Pragma("unroll")
#else
#define STICTION_UNROLL
#endif

namespace stiction {

/// A compiler for the device reads this: bounds of loops have to be constants where arrays are to be registers.
#if defined(__CUDACC__)
constexpr bool kForDevice = true;
#else
constexpr bool kForDevice = false;
#endif

}  // namespace stiction
