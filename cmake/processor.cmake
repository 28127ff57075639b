# Instruction sets of this machine's processor, as kernels/isa.cpp asks it when a program starts: STICTION_RUNS_AVX2,
# STICTION_RUNS_AVX512. A build for another machine runs none here.
if(CMAKE_CROSSCOMPILING AND NOT CMAKE_CROSSCOMPILING_EMULATOR)
  return()
endif()
include(CheckCXXSourceRuns)
check_cxx_source_runs(
  "int main() { return __builtin_cpu_supports(\"avx2\") && __builtin_cpu_supports(\"fma\") ? 0 : 1; }" STICTION_RUNS_AVX2)
check_cxx_source_runs(
  "int main() { return __builtin_cpu_supports(\"avx512f\") && __builtin_cpu_supports(\"avx512dq\") &&
                       __builtin_cpu_supports(\"avx512vl\") ? 0 : 1; }" STICTION_RUNS_AVX512)
