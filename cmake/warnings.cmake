# Warnings of our own targets; never exported.
add_library(stiction_warnings INTERFACE)
set(_w -Wall -Wextra -Wshadow -Wdouble-promotion -Wfloat-conversion -Wnon-virtual-dtor -Woverloaded-virtual)
# g++ 12 reports an overlap that is not there in std::string's own operator+ (GCC bug 105651).
if(CMAKE_CXX_COMPILER_ID STREQUAL "GNU")
  list(APPEND _w -Wno-restrict)
endif()
# g++ notes on AArch64 what is passed otherwise than by its versions before 10.
if(CMAKE_CXX_COMPILER_ID STREQUAL "GNU" AND CMAKE_SYSTEM_PROCESSOR MATCHES "aarch64|arm64|ARM64")
  list(APPEND _w -Wno-psabi)
endif()
# clang 19 reports that std::stable_sort of g++ 12's library calls a function of it that is deprecated.
if(CMAKE_CXX_COMPILER_ID MATCHES "Clang")
  list(APPEND _w -Wno-deprecated-declarations)
endif()
if(STICTION_WARNINGS_AS_ERRORS)
  list(APPEND _w -Werror)
  target_compile_options(stiction_warnings INTERFACE "$<$<COMPILE_LANGUAGE:CUDA>:SHELL:-Werror all-warnings>")
endif()
target_compile_options(stiction_warnings INTERFACE "$<$<COMPILE_LANGUAGE:CXX>:${_w}>"
                                                   "$<$<COMPILE_LANGUAGE:CUDA>:SHELL:-Xcompiler -Wall,-Wextra>")
