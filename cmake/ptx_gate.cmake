# Gates of a CUDA target's objects, read from the objects themselves (tools/fatbin.py): nothing is compiled
# a second time. Needs Python and no GPU.

# nvcc 13 compresses PTX to a tenth by a method that tools/fatbin.py reads; older ones are to leave it as text.
set(STICTION_READABLE_PTX "$<$<AND:$<COMPILE_LANGUAGE:CUDA>,$<VERSION_LESS:$<CUDA_COMPILER_VERSION>,13>>:--no-compress>")

# stiction_keep_ptx(target architectures...): the target's objects hold, next to the machine code of each architecture,
# the PTX it was made from. nvcc writes that PTX anyway. For builds with tests; others do without.
function(stiction_keep_ptx target)
  set(real)
  set(virtual)
  foreach(arch IN LISTS ARGN)
    if(NOT arch MATCHES "^([0-9]+)(-real|-virtual)?$")
      return()
    endif()
    if(CMAKE_MATCH_2 STREQUAL "-virtual")
      list(APPEND virtual "${CMAKE_MATCH_1}")
    else()
      list(APPEND real "${CMAKE_MATCH_1}")
    endif()
  endforeach()
  list(REMOVE_DUPLICATES real)
  list(REMOVE_ITEM virtual ${real})
  set(archs ${real} ${virtual})
  list(TRANSFORM virtual APPEND "-virtual")
  set(named ${real} ${virtual})
  set_target_properties(${target} PROPERTIES CUDA_ARCHITECTURES "${named}"
                                             STICTION_REAL_ARCHS "${real}" STICTION_PTX_ARCHS "${archs}")
  target_compile_options(${target} PRIVATE ${STICTION_READABLE_PTX})
endfunction()

# stiction_add_object_gates(target suffix budget): two tests over the target's objects. ptx_gate reads the PTX of every
# architecture (tools/check_ptx.py), ptxas_gate the machine code (tools/check_ptxas.py, a table in
# cuda/native; without one that test skips).
function(stiction_add_object_gates target suffix budget)
  find_package(Python3 QUIET COMPONENTS Interpreter)
  get_target_property(ptx ${target} STICTION_PTX_ARCHS)
  get_target_property(real ${target} STICTION_REAL_ARCHS)
  if(NOT Python3_FOUND OR NOT ptx OR NOT CMAKE_GENERATOR MATCHES "Ninja|Makefiles")
    message(STATUS "stiction: no Python interpreter, no numbered CUDA architectures or no compile_commands.json: the "
                   "gates over the CUDA objects are not part of the tests")
    return()
  endif()
  set(objects "$<FILTER:$<TARGET_OBJECTS:${target}>,INCLUDE,[.]cu[.]o>")
  list(TRANSFORM ptx PREPEND "--arch=")
  list(TRANSFORM real PREPEND "--arch=")
  add_test(NAME ptx_gate${suffix} COMMAND_EXPAND_LISTS
           COMMAND "${Python3_EXECUTABLE}" "${PROJECT_SOURCE_DIR}/tools/check_ptx.py" ${ptx}
                   --compile-commands "${CMAKE_BINARY_DIR}/compile_commands.json" "${objects}")
  set_tests_properties(ptx_gate${suffix} PROPERTIES LABELS "ptx" TIMEOUT 300 SKIP_RETURN_CODE 77)
  if(NOT real)
    return()
  endif()
  add_test(NAME ptxas_gate${suffix} COMMAND_EXPAND_LISTS
           COMMAND "${Python3_EXECUTABLE}" "${PROJECT_SOURCE_DIR}/tools/check_ptxas.py" ${real}
                   --budget "${PROJECT_SOURCE_DIR}/cuda/native/${budget}"
                   --compiler "${CMAKE_CUDA_COMPILER_VERSION}" "${objects}")
  set_tests_properties(ptxas_gate${suffix} PROPERTIES LABELS "ptx" TIMEOUT 300 SKIP_RETURN_CODE 77)
endfunction()
