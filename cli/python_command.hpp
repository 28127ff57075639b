#pragma once

namespace stiction::cli {

/// Returns true if the arguments are a command of the Python package: view, report, or step with a model's .xml.
bool is_python_command(int argc, char** argv);

/// Runs the package's command in place of this process, by the python3 on the path. Returns the exit status where there
/// is no such interpreter.
int run_python_command(char** argv);

}  // namespace stiction::cli
