# stiction_precompile(target): the headers that nearly every file of the library reads, compiled once per target: half of what
# such a file costs to compile is reading them. A file still includes what it uses; builds with
# CMAKE_DISABLE_PRECOMPILE_HEADERS=ON (scripts/sanitize.sh thread) show where one does not.
function(stiction_precompile target)
  target_precompile_headers(${target} PRIVATE <algorithm> <array> <cmath> <cstdint> <functional> <limits> <memory> <numeric>
                            <optional> <span> <string> <utility> <vector> <stiction/stiction.hpp> ${ARGN})
  if(CMAKE_CXX_COMPILER_ID STREQUAL "GNU")
    target_compile_options(${target} PRIVATE -fpch-preprocess)  # what ccache needs to see through a precompiled header
  endif()
endfunction()
