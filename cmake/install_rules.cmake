# Places of `cmake --install`, so that find_package(stiction CONFIG) gives stiction::stiction and, when files are
# supported, stiction::io; and C programs stiction::c or pkg-config's stiction. The installed tree names no path of the build
# and may be moved. Three components are what packages are made of (cmake/packages.cmake): library, the shared library of the
# C interface; development; tools.
include(GNUInstallDirs)
include(CMakePackageConfigHelpers)

set(_stiction_package_dir "${CMAKE_INSTALL_LIBDIR}/cmake/stiction")
set(_stiction_targets)
foreach(name IN ITEMS facade core cpu device cuda c)
  if(TARGET stiction_${name})
    set_target_properties(stiction_${name} PROPERTIES EXPORT_NAME ${name})
    list(APPEND _stiction_targets stiction_${name})
  endif()
endforeach()
list(APPEND _stiction_targets stiction)

set(STICTION_CUDA_NEEDS_TOOLKIT OFF)
if(TARGET stiction_cuda)
  get_target_property(_stiction_cuda_type stiction_cuda TYPE)
  if(NOT _stiction_cuda_type STREQUAL "SHARED_LIBRARY")
    set(STICTION_CUDA_NEEDS_TOOLKIT ON)
  endif()
endif()

install(TARGETS ${_stiction_targets} EXPORT stictionTargets
        RUNTIME DESTINATION "${CMAKE_INSTALL_BINDIR}" COMPONENT tools
        LIBRARY DESTINATION "${CMAKE_INSTALL_LIBDIR}" COMPONENT library NAMELINK_COMPONENT development
        ARCHIVE DESTINATION "${CMAKE_INSTALL_LIBDIR}" COMPONENT development
        INCLUDES DESTINATION "${CMAKE_INSTALL_INCLUDEDIR}")
install(DIRECTORY core/include/ DESTINATION "${CMAKE_INSTALL_INCLUDEDIR}" COMPONENT development FILES_MATCHING PATTERN "*.hpp")
if(TARGET stiction_c)
  install(DIRECTORY c_api/include/ "${PROJECT_BINARY_DIR}/c_api/include/" DESTINATION "${CMAKE_INSTALL_INCLUDEDIR}"
          COMPONENT development FILES_MATCHING PATTERN "*.h")
  # Relative to the file itself, so that the tree may be moved; not if the place of libraries was fixed.
  if(IS_ABSOLUTE "${CMAKE_INSTALL_LIBDIR}" OR IS_ABSOLUTE "${CMAKE_INSTALL_INCLUDEDIR}")
    set(STICTION_PC_LIBDIR "${CMAKE_INSTALL_FULL_LIBDIR}")
    set(STICTION_PC_INCLUDEDIR "${CMAKE_INSTALL_FULL_INCLUDEDIR}")
  else()
    file(RELATIVE_PATH _to_prefix "/prefix/${CMAKE_INSTALL_LIBDIR}/pkgconfig" "/prefix")
    string(REGEX REPLACE "/$" "" _to_prefix "${_to_prefix}")
    set(STICTION_PC_LIBDIR "\${pcfiledir}/${_to_prefix}/${CMAKE_INSTALL_LIBDIR}")
    set(STICTION_PC_INCLUDEDIR "\${pcfiledir}/${_to_prefix}/${CMAKE_INSTALL_INCLUDEDIR}")
  endif()
  configure_file(cmake/stiction.pc.in "${CMAKE_CURRENT_BINARY_DIR}/stiction.pc" @ONLY)
  install(FILES "${CMAKE_CURRENT_BINARY_DIR}/stiction.pc" DESTINATION "${CMAKE_INSTALL_LIBDIR}/pkgconfig" COMPONENT development)
endif()
# Files are an export of their own: a consumer that has no HDF5 still gets the solver.
if(TARGET stiction_io)
  set_target_properties(stiction_io PROPERTIES EXPORT_NAME io)
  install(TARGETS stiction_io EXPORT stictionIoTargets
          ARCHIVE DESTINATION "${CMAKE_INSTALL_LIBDIR}" COMPONENT development
          INCLUDES DESTINATION "${CMAKE_INSTALL_INCLUDEDIR}")
  install(EXPORT stictionIoTargets NAMESPACE stiction:: DESTINATION "${_stiction_package_dir}" COMPONENT development)
  install(DIRECTORY core/io/include/ DESTINATION "${CMAKE_INSTALL_INCLUDEDIR}" COMPONENT development FILES_MATCHING PATTERN "*.hpp")
endif()
foreach(program IN ITEMS stiction_cli stiction_mpi)
  if(TARGET ${program})
    install(TARGETS ${program} RUNTIME DESTINATION "${CMAKE_INSTALL_BINDIR}" COMPONENT tools)
  endif()
endforeach()
install(FILES LICENSE CHANGELOG.md DESTINATION "${CMAKE_INSTALL_DOCDIR}" COMPONENT development)

install(EXPORT stictionTargets NAMESPACE stiction:: DESTINATION "${_stiction_package_dir}" COMPONENT development)
configure_package_config_file(cmake/stictionConfig.cmake.in "${CMAKE_CURRENT_BINARY_DIR}/stictionConfig.cmake"
                              INSTALL_DESTINATION "${_stiction_package_dir}"
                              NO_SET_AND_CHECK_MACRO)
write_basic_package_version_file("${CMAKE_CURRENT_BINARY_DIR}/stictionConfigVersion.cmake"
                                 VERSION ${PROJECT_VERSION} COMPATIBILITY SameMajorVersion)
install(FILES "${CMAKE_CURRENT_BINARY_DIR}/stictionConfig.cmake"
              "${CMAKE_CURRENT_BINARY_DIR}/stictionConfigVersion.cmake"
        DESTINATION "${_stiction_package_dir}" COMPONENT development)
