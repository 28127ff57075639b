# cmake -DREADME=README.md -DPROGRAM=file.cpp -P check_readme.cmake: fails unless the page shows that very program.
file(READ "${README}" readme)
file(READ "${PROGRAM}" program)
string(FIND "${readme}" "```cpp\n${program}```\n" position)
if(program STREQUAL "" OR position EQUAL -1)
  message(FATAL_ERROR "${README} does not show ${PROGRAM} as it is: copy it between ```cpp and ```")
endif()
