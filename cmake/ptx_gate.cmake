# stiction_add_ptx_gate(target): a test that compiles every .cu file of the target to PTX, with the build's own command
# for it, and reads the result (tools/check_ptx.py). Needs nvcc and no GPU.
function(stiction_add_ptx_gate target)
  find_package(Python3 QUIET COMPONENTS Interpreter)
  if(NOT Python3_FOUND)
    message(STATUS "stiction: no Python interpreter, the PTX gate is not part of the tests")
    return()
  endif()
  if(NOT CMAKE_GENERATOR MATCHES "Ninja|Makefiles")
    message(STATUS "stiction: ${CMAKE_GENERATOR} writes no compile_commands.json, the PTX gate is not part of the tests")
    return()
  endif()
  get_target_property(sources ${target} SOURCES)
  get_target_property(folder ${target} SOURCE_DIR)
  list(FILTER sources INCLUDE REGEX "\\.cu$")
  list(TRANSFORM sources PREPEND "${folder}/" REGEX "^[^/]")
  add_test(NAME ptx_gate
           COMMAND "${Python3_EXECUTABLE}" "${PROJECT_SOURCE_DIR}/tools/check_ptx.py"
                   --compile-commands "${CMAKE_BINARY_DIR}/compile_commands.json" --arch 80 --arch 90
                   --out "${CMAKE_BINARY_DIR}/ptx" ${sources})
  set_tests_properties(ptx_gate PROPERTIES LABELS "ptx" TIMEOUT 900 PROCESSORS 2)
endfunction()
