# The library as the tests link it: one shared library of the very objects that are in the static ones. Each of the
# tests with all of them inside, GPU code of every solver included, takes 110 MB, and all of them 13 GB of disk.
# Defines the target stiction_tested.
set(_parts stiction_core stiction_cpu stiction_device stiction_scenes)
foreach(part IN ITEMS stiction_cuda stiction_io)
  if(TARGET ${part})
    list(APPEND _parts ${part})
  endif()
endforeach()

add_library(stiction_tested SHARED tested_library.cpp)
target_link_libraries(stiction_tested PRIVATE ${_parts} PUBLIC stiction_fp Threads::Threads)
set(_archives ${_parts})
list(TRANSFORM _archives REPLACE "(.+)" "$<TARGET_FILE:\\1>")
string(REPLACE ";" "," _archives "${_archives}")
# What the tests instantiate of inline functions, not optimised, must not take the place of what the library has.
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
