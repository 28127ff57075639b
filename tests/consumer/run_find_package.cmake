# cmake -DBUILD_DIR= -DSOURCE_DIR= -DWORK_DIR= -DGENERATOR= -DCXX= -P: installs the build into a prefix, and moves the
# prefix. An installed tree that names its own place would not survive that. Builds and runs the consumer against it.
function(run)
  execute_process(COMMAND ${ARGV} RESULT_VARIABLE status OUTPUT_VARIABLE output ERROR_VARIABLE output)
  if(NOT status EQUAL 0)
    message(FATAL_ERROR "${ARGV}\n${output}")
  endif()
  message("${output}")
endfunction()

file(REMOVE_RECURSE "${WORK_DIR}")
run("${CMAKE_COMMAND}" --install "${BUILD_DIR}" --prefix "${WORK_DIR}/installed")
file(RENAME "${WORK_DIR}/installed" "${WORK_DIR}/moved")
file(GLOB_RECURSE package "${WORK_DIR}/moved/*.cmake")
foreach(file IN LISTS package)
  file(STRINGS "${file}" leaks REGEX "${BUILD_DIR}|${SOURCE_DIR}/core")
  if(leaks)
    message(FATAL_ERROR "${file} names the build: ${leaks}")
  endif()
endforeach()
run("${CMAKE_COMMAND}" -S "${SOURCE_DIR}/tests/consumer/find_package" -B "${WORK_DIR}/build" -G "${GENERATOR}"
    "-DCMAKE_CXX_COMPILER=${CXX}" "-DCMAKE_CXX_FLAGS=${CXX_FLAGS}" -DCMAKE_BUILD_TYPE=Release
    "-DCMAKE_PREFIX_PATH=${WORK_DIR}/moved" "-DCUDAToolkit_ROOT=${CUDA_ROOT}")
run("${CMAKE_COMMAND}" --build "${WORK_DIR}/build")
run("${WORK_DIR}/build/consumer")
if(EXISTS "${WORK_DIR}/build/consumer_io")
  run("${WORK_DIR}/build/consumer_io")
endif()
