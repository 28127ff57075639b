# stiction_precompile(target): the headers that nearly every file of the library reads, compiled once per target. Half of what
# such a file costs to compile is reading them. A file still includes what it uses; builds with
# CMAKE_DISABLE_PRECOMPILE_HEADERS=ON (scripts/sanitize.sh thread) show where one does not.
#
# None of our own headers is among them, here or elsewhere. GCC knows a header with #pragma once again by its bytes; ccache
# knows a precompiled header by its preprocessed text. After an edit of a comment alone it hands out the one that was made
# of the old bytes. Every class of that header is defined twice.
function(stiction_precompile target)
  target_precompile_headers(${target} PRIVATE <algorithm> <array> <cmath> <cstdint> <functional> <limits> <memory> <numeric>
                            <optional> <span> <string> <utility> <vector> ${ARGN})
  if(CMAKE_CXX_COMPILER_ID STREQUAL "GNU")
    target_compile_options(${target} PRIVATE -fpch-preprocess)  # what ccache needs to see through a precompiled header
  endif()
endfunction()
