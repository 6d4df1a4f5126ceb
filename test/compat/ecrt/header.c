/* ecrt.h as C; also from C++, see header.cpp. */
#include "header.h"

int main(void) { return check_header(); }
