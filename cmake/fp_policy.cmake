# The floating-point policy, in one place (reasons: docs/explanation/numerics.md). Every target that compiles an
# algorithm links it, and it is an interface of the header target, because one translation unit built otherwise is
# enough to change bits.   contract off   a compiler may fuse a*b+c on one machine and not on another; fused is only
# what says fma_()   no errno/traps what lets sqrt and selects vectorise; changes no value
#   no SLP (GCC)   GCC 12 fuses a difference and a sum of products that lie side by side into vfmaddsub or vfmsubadd,
#                  whatever -ffp-contract says. Only its vectoriser of straight-line code does it. The gate `fused_gate`
#                  reads every object for what was not written
#   device         the same statements for nvcc, and the host flags for its host pass, which --fmad does not reach
add_library(stiction_fp INTERFACE)
target_compile_options(stiction_fp INTERFACE
  "$<$<COMPILE_LANGUAGE:CXX>:-ffp-contract=off;-fno-math-errno;-fno-trapping-math>"
  "$<$<COMPILE_LANG_AND_ID:CXX,GNU>:-fno-tree-slp-vectorize>"
  "$<$<COMPILE_LANGUAGE:CUDA>:--fmad=false;--prec-div=true;--prec-sqrt=true;--ftz=false>"
  "$<$<COMPILE_LANGUAGE:CUDA>:SHELL:-Xcompiler -ffp-contract=off,-fno-math-errno,-fno-trapping-math>")
target_compile_features(stiction_fp INTERFACE cxx_std_20)

foreach(flags IN ITEMS "${CMAKE_CXX_FLAGS}" "${CMAKE_CXX_FLAGS_RELEASE}" "${CMAKE_CUDA_FLAGS}")
  if(flags MATCHES "-ffast-math|-Ofast|-funsafe-math|-fassociative-math|use_fast_math")
    message(FATAL_ERROR "stiction gives the same bits everywhere and cannot be built with '${flags}': remove the "
                        "fast-math option")
  endif()
endforeach()

# stiction_keep_lines(target ...): which line each instruction came from, so that tools/check_fused.py can tell a fused
# operation that fma_() asked for from one that a compiler made. Changes no instruction. The lines are of /stiction,
# wherever the tree lies: ccache may hand an object of one clone to another.
set(STICTION_KEEP_LINES AUTO CACHE STRING
    "Keep the lines that instructions came from, which the gate of fused operations reads: ON, OFF, or AUTO, where tests are built")
set_property(CACHE STICTION_KEEP_LINES PROPERTY STRINGS AUTO ON OFF)
set(_stiction_keeps_lines ${STICTION_KEEP_LINES})
if(STICTION_KEEP_LINES STREQUAL "AUTO")
  set(_stiction_keeps_lines ${STICTION_BUILD_TESTS})
endif()
# The baseline of x86-64 has no fused operation. Unless the whole build is for a newer processor, only sets with vectors
# of their own have lines. All else is one object with lines and without.
set(_stiction_fuses_anywhere ON)
if(CMAKE_SYSTEM_PROCESSOR MATCHES "x86_64|AMD64" AND NOT "${CMAKE_CXX_FLAGS} ${CMAKE_CXX_FLAGS_RELEASE}" MATCHES "-m(arch|fma|avx)")
  set(_stiction_fuses_anywhere OFF)
endif()
# The gate reads objects. Release builds link programs without these lines, 40 MB each, unless the flags have a -g.
set(_stiction_links_lines ON)
if(NOT "${CMAKE_CXX_FLAGS} ${CMAKE_CXX_FLAGS_RELEASE} ${STICTION_LIBRARY_OPTIONS}" MATCHES "-g")
  set(_stiction_links_lines OFF)
endif()
function(stiction_keep_lines)
  if(NOT _stiction_keeps_lines OR NOT CMAKE_CXX_COMPILER_ID MATCHES "GNU|Clang")
    return()
  endif()
  foreach(target IN LISTS ARGN)
    get_target_property(options ${target} COMPILE_OPTIONS)
    if(_stiction_fuses_anywhere OR "-mfma" IN_LIST options)
      target_compile_options(${target} PRIVATE -g1 "-fdebug-prefix-map=${PROJECT_SOURCE_DIR}=/stiction")
    endif()
    if(NOT _stiction_links_lines)
      target_link_options(${target} INTERFACE "$<BUILD_INTERFACE:$<$<CONFIG:Release>:LINKER:-S>>")
    endif()
  endforeach()
endfunction()
