/* Maps a segment as a program of the interface does, and compares sizes, places and FMMUs with a file of what the
   original master showed: layouts SOURCE MODE FILE. */
#ifdef SOEM2
#include <soem/soem.h>
static ecx_contextt context;
#define CTX (&context)
#define SLAVES context.slavelist
#define GROUPS context.grouplist
#define COUNT context.slavecount
#else
#include <ethercat.h>
#define MOST 256
static ecx_portt port;
static ec_slavet slaves[MOST];
static int count;
static ec_groupt groups[EC_MAXGROUP];
static uint8 esibuf[EC_MAXEEPBUF];
static uint32 esimap[EC_MAXEEPBITMAP];
static ec_eringt errors;
static ec_idxstackT stack;
static boolean flag;
static int64 dctime;
static ec_SMcommtypet types;
static ec_PDOassignt assign;
static ec_PDOdesct desc;
static ec_eepromSMt sm;
static ec_eepromFMMUt fmmu;
static ecx_contextt context = {&port, slaves, &count, MOST, groups, EC_MAXGROUP, esibuf, esimap, 0, &errors, &stack, &flag, 0, 0,
                               &dctime, &types, &assign, &desc, &sm, &fmmu, NULL, NULL, 0, NULL};
#define CTX (&context)
#define SLAVES slaves
#define GROUPS groups
#define COUNT count
#endif

#include <stdio.h>
#include <string.h>

static char map[65536];
static char line[512];

static void place(char *into, const uint8 *at, int startbit) {
    if (at == NULL)
        strcpy(into, "-");
    else
        sprintf(into, "%d.%d", (int)(at - (uint8 *)map), startbit);
}

static void describe_fmmu(char *into, const char *name, const ec_fmmut *f) {
    sprintf(into, "%s log %u len %u bits %u-%u type %u", name, (unsigned)etohl(f->LogStart), (unsigned)etohs(f->LogLength),
            f->LogStartbit, f->LogEndbit, f->FMMUtype);
}

/* The bits and octets of a slave without data have no meaning in the interface, only their number. */
static int differs(FILE *golden, const char *got) {
    static char wanted[2048];
    if (fgets(wanted, sizeof(wanted), golden) == NULL) strcpy(wanted, "(nothing)");
    wanted[strcspn(wanted, "\n")] = '\0';
    while (wanted[0] != '\0' && wanted[strlen(wanted) - 1] == ' ') wanted[strlen(wanted) - 1] = '\0';
    if (strcmp(wanted, got) == 0) return 0;
    printf("wanted: %s\ngot:    %s\n", wanted, got);
    return 1;
}

int main(int argc, char **argv) {
    FILE *golden;
    int used, n, wrong = 0;
    char o[32], i[32], f0[96], f1[96];
    if (argc != 4) return 2;
    golden = fopen(argv[3], "r");
    if (golden == NULL) {
        printf("skipped: no %s\n", argv[3]);
        return 77;
    }
    memset(map, 0x55, sizeof(map));
    if (!ecx_init(CTX, argv[1])) return 1;
#ifdef SOEM2
    context.overlappedMode = strcmp(argv[2], "overlapped") == 0;
    context.packedMode = strcmp(argv[2], "packed") == 0;
    if (ecx_config_init(CTX) <= 0) return 1;
    used = ecx_config_map_group(CTX, map, 0);
#else
    if (ecx_config_init(CTX, FALSE) <= 0) return 1;
    used = strcmp(argv[2], "overlapped") == 0 ? ecx_config_overlap_map_group(CTX, map, 0) : ecx_config_map_group(CTX, map, 0);
#endif
    sprintf(line, "map %d Obytes %u Ibytes %u outputsWKC %u inputsWKC %u nsegments %u", used, (unsigned)GROUPS[0].Obytes,
            (unsigned)GROUPS[0].Ibytes, GROUPS[0].outputsWKC, GROUPS[0].inputsWKC, GROUPS[0].nsegments);
    wrong += differs(golden, line);
    strcpy(line, "IOsegment:");
    for (n = 0; n < GROUPS[0].nsegments; ++n) sprintf(line + strlen(line), " %u", (unsigned)GROUPS[0].IOsegment[n]);
    wrong += differs(golden, line);
    for (n = 1; n <= COUNT; ++n) {
        const ec_slavet *s = &SLAVES[n];
        place(o, s->outputs, s->Ostartbit);
        place(i, s->inputs, s->Istartbit);
        describe_fmmu(f0, "FMMU0", &s->FMMU[0]);
        describe_fmmu(f1, "FMMU1", &s->FMMU[1]);
        sprintf(line, "%d %s O %u bits %u bytes at %s I %u bits %u bytes at %s %s; %s", n, s->name, s->Obits,
                (unsigned)s->Obytes, o, s->Ibits, (unsigned)s->Ibytes, i, f0, f1);
        wrong += differs(golden, line);
    }
    if (fgets(line, sizeof(line), golden) != NULL) {
        printf("wanted more: %s\n", line);
        ++wrong;
    }
    /* Nothing of the memory of the program was touched. */
    for (n = 0; n < (int)sizeof(map); ++n)
        if (map[n] != 0x55) {
            printf("octet %d of the image was written\n", n);
            ++wrong;
            break;
        }
    ecx_close(CTX);
    fclose(golden);
    printf("%d slaves, %d differences\n", COUNT, wrong);
    return wrong == 0 ? 0 : 1;
}
