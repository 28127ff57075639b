#include "tests/support/common_headers.hpp"

template class std::vector<char>;
template class std::vector<unsigned char>;
template class std::vector<int>;
template class std::vector<long>;
template class std::vector<unsigned long>;
template class std::vector<float>;
template class std::vector<double>;
template class std::vector<std::string>;
