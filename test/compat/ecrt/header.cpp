// ecrt.h as C++.
#include <header.h>

int main() { return check_header(); }
