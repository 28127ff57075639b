# The library as the tests link it: one shared library of the very objects that are in the static ones. Each of the
# tests with all of them inside, GPU code of every solver included, takes 110 MB. All of them 13 GB of disk.
# Defines the target stiction_tested.
set(_parts stiction_facade stiction_core stiction_cpu stiction_scenes)
foreach(part IN ITEMS stiction_device stiction_cuda stiction_io)
  if(TARGET ${part})
    list(APPEND _parts ${part})
  endif()
endforeach()

# Packs of 16 and of 64 bytes, whatever vectors the machine has. The first are those of any x86-64 or of NEON, the second are
# split by the compiler. They are the tests' own and reach the library's tables when the shared library is loaded. No
# others of 64 bytes are needed if the library's own for AVX-512 run.
set(_widths)
set(_tested_widths)
stiction_solver_table(_table ${PROJECT_SOURCE_DIR}/cpu_fallback/kernels/solvers.cpp.in isa/solvers.cpp ${STICTION_SWEEPING_SOLVERS})
set(_sweeping ${STICTION_SWEEPING_SOLVERS})
list(TRANSFORM _sweeping REPLACE "(.+)" "${PROJECT_BINARY_DIR}/cpu_fallback/kernels/\\1.cpp")
if(TARGET stiction_cpu_avx2)
  if(NOT STICTION_LIBRARY_OPTIONS)  # a sanitizer sees in the library's packs what it would in others
    list(APPEND _tested_widths narrow)
    if(NOT TARGET stiction_cpu_avx512 OR NOT STICTION_RUNS_AVX512)
      list(APPEND _tested_widths wide)
    endif()
  endif()
  foreach(width IN LISTS _tested_widths)
    set(bytes 16)
    set(options -O1 "$<$<CXX_COMPILER_ID:GNU>:-Wno-psabi>")  # GCC notes how vectors that are split are passed
    if(width STREQUAL "wide")
      set(bytes 64)
      list(APPEND options -mavx2 -mfma)
    endif()
    set(kernels articulated.cpp shared_instances.cpp contact_derivative.cpp sequential_impulses.cpp jacobian.cpp velocity.cpp
        jacobian_pack.cpp velocity_blocks.cpp)
    list(TRANSFORM kernels PREPEND "${PROJECT_SOURCE_DIR}/cpu_fallback/kernels/")
    add_library(stiction_test_${width} OBJECT isa/pack_width.cpp ${_table} ${_sweeping} ${kernels})
    target_include_directories(stiction_test_${width} PRIVATE ${PROJECT_SOURCE_DIR} ${PROJECT_SOURCE_DIR}/core/include)
    target_compile_definitions(stiction_test_${width} PRIVATE STICTION_ISA=isa_test_${width}
      STICTION_ISA_NAME="${width}" STICTION_VECTOR_BYTES=${bytes} STICTION_PACKS_ALONE)
    # Optimised little: what they are for is width, not speed.
    target_compile_options(stiction_test_${width} PRIVATE ${options})
    target_link_libraries(stiction_test_${width} PRIVATE stiction_fp stiction_warnings)
    stiction_keep_lines(stiction_test_${width})
    list(APPEND _widths $<TARGET_OBJECTS:stiction_test_${width}>)
  endforeach()
endif()

add_library(stiction_tested SHARED tested_library.cpp ${_widths})
target_link_libraries(stiction_tested PRIVATE ${_parts} PUBLIC stiction_fp Threads::Threads)
set(_archives ${_parts})
list(TRANSFORM _archives REPLACE "(.+)" "$<TARGET_FILE:\\1>")
string(REPLACE ";" "," _archives "${_archives}")
# Inline functions that tests instantiate, not optimised, must not take the place of the library's.
target_link_options(stiction_tested PRIVATE "LINKER:--whole-archive,${_archives},--no-whole-archive" LINKER:-Bsymbolic-functions)
# All that those who link the parts are given, but for the parts.
target_compile_features(stiction_tested INTERFACE cxx_std_20)
foreach(part IN LISTS _parts)
  target_include_directories(stiction_tested INTERFACE $<TARGET_PROPERTY:${part},INTERFACE_INCLUDE_DIRECTORIES>)
  target_include_directories(stiction_tested SYSTEM INTERFACE $<TARGET_PROPERTY:${part},INTERFACE_SYSTEM_INCLUDE_DIRECTORIES>)
  target_compile_definitions(stiction_tested INTERFACE $<TARGET_PROPERTY:${part},INTERFACE_COMPILE_DEFINITIONS>)
endforeach()
# Tests call HDF5 themselves to make malformed files.
if(TARGET stiction_io)
  target_link_libraries(stiction_tested PUBLIC ${HDF5_C_LIBRARIES})
endif()
