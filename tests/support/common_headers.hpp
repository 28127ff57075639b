#pragma once

/// What most tests read. Precompiled (tests/CMakeLists.txt); a test still includes what it uses.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <fstream>
#include <functional>
#include <limits>
#include <memory>
#include <optional>
#include <random>
#include <span>
#include <sstream>
#include <string>
#include <thread>
#include <vector>

#include "stiction/error.hpp"
#include "stiction/solver.hpp"

// common_instances.cpp holds the code of these: a test compiles none of it.
extern template class std::vector<char>;
extern template class std::vector<unsigned char>;
extern template class std::vector<int>;
extern template class std::vector<long>;
extern template class std::vector<unsigned long>;
extern template class std::vector<float>;
extern template class std::vector<double>;
extern template class std::vector<std::string>;
extern template class std::vector<stiction::EnvStatus>;
extern template class std::vector<stiction::ConeKind>;
extern template class std::vector<stiction::Environment<double>>;
extern template class std::vector<stiction::Environment<double>::Cone>;
