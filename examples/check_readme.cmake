# cmake -DREADME=README.md -DPROGRAM=file.cpp -DFENCE=cpp -P check_readme.cmake: fails unless the page shows that very
# program between fences of that language.
file(READ "${README}" readme)
file(READ "${PROGRAM}" program)
string(FIND "${readme}" "```${FENCE}\n${program}```\n" position)
if(program STREQUAL "" OR position EQUAL -1)
  message(FATAL_ERROR "${README} does not show ${PROGRAM} as it is: copy it between ```${FENCE} and ```")
endif()
