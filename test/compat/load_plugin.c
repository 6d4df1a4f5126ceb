/* Loads a plugin and starts it. load_plugin FILE SOURCE SLAVES */
#include <dlfcn.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

int main(int argc, char** argv) {
    int (*start)(const char*);
    void* plugin = argc == 4 ? dlopen(argv[1], RTLD_NOW | RTLD_LOCAL) : NULL;
    void* symbol = plugin != NULL ? dlsym(plugin, "plugin_start") : NULL;
    if (symbol == NULL) {
        printf("%s\n", argc == 4 ? dlerror() : "load_plugin FILE SOURCE SLAVES");
        return 2;
    }
    memcpy(&start, &symbol, sizeof(start));
    return start(argv[2]) != atoi(argv[3]);
}
