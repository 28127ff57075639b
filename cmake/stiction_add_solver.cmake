# Sources made of the list of solvers (cmake/solvers.cmake) when CMake runs. They are, for each solver, a small one on each
# machine, their tables, its number and name, its torture test. Everything is made of a template (*.in), which lies beside the
# sources that are written by hand. It is made into the same folder of the build tree.
#
# In a template @solver@ is the name, @SOLVER@ the name in capitals, @Method@ the class, @header@ its header from
# core/algorithm/solver on. @number@ is the number, @factorises@ true or false, @solver_count@ how many there are.
set(STICTION_SOLVERS)
set(STICTION_FACTORISING_SOLVERS)
set(STICTION_SWEEPING_SOLVERS)  # all others
set(STICTION_WIDE_SOLVERS)

# stiction_add_solver(solver Method [FACTORISES] [WIDE_PACKS]): the next solver of SolverKind, by its enumerator and its class in
# core/algorithm/solver/<solver>.hpp or <solver>/<solver>.hpp.
#   FACTORISES   its workspace() is that of a method that factorises. It takes environments one at a time, never in packs, and what
#                pays in its code are vectors in its loops (cpu_fallback/CMakeLists.txt)
#   WIDE_PACKS   its packs are compiled for AVX-512, too: sweeps, the only ones that wider vectors make faster
function(stiction_add_solver solver method)
  cmake_parse_arguments(PARSE_ARGV 2 arg "FACTORISES;WIDE_PACKS" "" "")
  if(arg_UNPARSED_ARGUMENTS OR (arg_FACTORISES AND arg_WIDE_PACKS))
    message(FATAL_ERROR "stiction_add_solver(${solver} ${method} ${ARGN}): give FACTORISES or WIDE_PACKS or nothing")
  endif()
  set(folder "${PROJECT_SOURCE_DIR}/core/algorithm/solver")
  set(header "${solver}.hpp")
  if(NOT EXISTS "${folder}/${header}")
    set(header "${solver}/${solver}.hpp")
  endif()
  if(NOT EXISTS "${folder}/${header}")
    message(FATAL_ERROR "stiction_add_solver(${solver} ${method}): there is no ${folder}/${solver}.hpp")
  endif()
  list(LENGTH STICTION_SOLVERS number)
  set(STICTION_SOLVERS ${STICTION_SOLVERS} ${solver} PARENT_SCOPE)
  set(STICTION_SOLVER_${solver} ${method} ${header} ${number} PARENT_SCOPE)
  if(arg_FACTORISES)
    set(STICTION_FACTORISING_SOLVERS ${STICTION_FACTORISING_SOLVERS} ${solver} PARENT_SCOPE)
  else()
    set(STICTION_SWEEPING_SOLVERS ${STICTION_SWEEPING_SOLVERS} ${solver} PARENT_SCOPE)
  endif()
  if(arg_WIDE_PACKS)
    set(STICTION_WIDE_SOLVERS ${STICTION_WIDE_SOLVERS} ${solver} PARENT_SCOPE)
  endif()
endfunction()

# Sets what a template may name.
macro(_stiction_describe solver)
  list(GET STICTION_SOLVER_${solver} 0 Method)
  list(GET STICTION_SOLVER_${solver} 1 header)
  list(GET STICTION_SOLVER_${solver} 2 number)
  list(LENGTH STICTION_SOLVERS solver_count)
  string(TOUPPER ${solver} SOLVER)
  set(factorises false)
  if("${solver}" IN_LIST STICTION_FACTORISING_SOLVERS)
    set(factorises true)
  endif()
endmacro()

# stiction_solver_sources(result template solvers...): one source for each solver. The word "solver" in the template's name becomes
# the solver's: native/cuda_solver.cu.in gives native/cuda_pgs.cu and so on.
function(stiction_solver_sources result template)
  set(sources)
  foreach(solver IN LISTS ARGN)
    _stiction_describe(${solver})
    string(REGEX REPLACE "solver([^/]*)[.]in$" "${solver}\\1" name "${template}")
    configure_file("${template}" "${CMAKE_CURRENT_BINARY_DIR}/${name}" @ONLY)
    list(APPEND sources "${CMAKE_CURRENT_BINARY_DIR}/${name}")
  endforeach()
  set(${result} ${sources} PARENT_SCOPE)
endfunction()

# stiction_solver_table(result template name solvers...): one file, `name`, of all these solvers. A line of the template that
# names @solver@ or @SOLVER@ is written once for each of them.
function(stiction_solver_table result template name)
  get_filename_component(template "${template}" ABSOLUTE)
  set_property(DIRECTORY APPEND PROPERTY CMAKE_CONFIGURE_DEPENDS "${template}")
  file(READ "${template}" rest)
  if(NOT rest MATCHES "\n$")
    string(APPEND rest "\n")
  endif()
  set(table "")
  while(NOT rest STREQUAL "")
    string(FIND "${rest}" "\n" length)
    math(EXPR length "${length} + 1")
    string(SUBSTRING "${rest}" 0 ${length} line)
    string(SUBSTRING "${rest}" ${length} -1 rest)
    set(solvers once)
    if(line MATCHES "@(solver|SOLVER)@")
      set(solvers ${ARGN})
    endif()
    foreach(solver IN LISTS solvers)
      if(NOT solver STREQUAL "once")
        _stiction_describe(${solver})
      endif()
      string(CONFIGURE "${line}" written @ONLY)
      string(APPEND table "${written}")
    endforeach()
  endwhile()
  file(CONFIGURE OUTPUT "${CMAKE_CURRENT_BINARY_DIR}/${name}" CONTENT "${table}" @ONLY)
  set(${result} "${CMAKE_CURRENT_BINARY_DIR}/${name}" PARENT_SCOPE)
endfunction()
