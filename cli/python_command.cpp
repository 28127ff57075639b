#include "cli/python_command.hpp"

#include <unistd.h>

#include <algorithm>
#include <cstdio>
#include <string_view>
#include <vector>

#include "cli/commands.hpp"

namespace stiction::cli {

namespace {

/// A missing package is named in a sentence; the command itself names other faults.
constexpr const char* kProgram = R"(
import sys
try:
    from stiction.__main__ import main
except ModuleNotFoundError as missing:
    if missing.name != "stiction":
        raise
    print("stiction: view, report and step of a model need the Python package, which python3 has not: "
          "see docs/howto/install.md", file=sys.stderr)
    sys.exit(2)
sys.exit(main())
)";

}  // namespace

bool is_python_command(int argc, char** argv) {
  if (argc < 2) return false;
  const std::string_view name = argv[1];
  const auto is_model = [](std::string_view argument) { return argument.ends_with(".xml"); };
  return name == "view" || name == "report" || (name == "step" && std::any_of(argv + 2, argv + argc, is_model));
}

int run_python_command(char** argv) {
  std::vector<const char*> arguments{"python3", "-c", kProgram};
  for (char** argument = argv + 1; *argument != nullptr; ++argument) arguments.push_back(*argument);
  arguments.push_back(nullptr);
  ::execvp(arguments.front(), const_cast<char* const*>(arguments.data()));
  std::fputs("stiction: view, report and step of a model need python3, which is not on the path\n", stderr);
  return kExitBadInput;
}

}  // namespace stiction::cli
