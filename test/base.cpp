// Empty on purpose: the target of this file compiles the precompiled headers for all test programs.
