// The style sheet of the page: light and dark by the wish of the reader, light on paper.
#pragma once

#include <string_view>

namespace margay::segment_report {

// No `<` and no `&`: the page is XML, too.
inline constexpr std::string_view kStyle = R"(
:root{color-scheme:light dark;--ink:#1c2229;--soft:#57616c;--line:#d3d9df;--paper:#fff;--panel:#f4f6f8;--good:#1a7f37;
--remark:#9a6700;--fault:#c4202b;--link:#0b5cad;--bar:#3a7ca5;--fault-panel:#fdeeee;--remark-panel:#fdf6e3}
@media screen and (prefers-color-scheme:dark){:root{--ink:#e4e8ec;--soft:#9da7b1;--line:#3a424b;--paper:#14181d;
--panel:#1d232a;--good:#4cc26a;--remark:#e0af45;--fault:#ff7b72;--link:#6cb2f7;--bar:#5b9fc9;--fault-panel:#35191b;
--remark-panel:#2f2712}}
*{box-sizing:border-box}
html{scroll-padding-top:1rem}
body{margin:0 auto;max-width:82rem;padding:1.25rem 1.5rem 4rem;background:var(--paper);color:var(--ink);
font:15px/1.5 system-ui,-apple-system,"Segoe UI","Noto Sans","DejaVu Sans",sans-serif;overflow-wrap:break-word}
h1{font-size:1.6rem;line-height:1.25;margin:0}
h2{font-size:1.2rem;margin:2.6rem 0 .7rem;padding-bottom:.25rem;border-bottom:1px solid var(--line)}
h3{font-size:1rem;margin:1.4rem 0 .4rem}
p{margin:.4rem 0;max-width:60rem}
a{color:var(--link);text-decoration:none}
a:hover{text-decoration:underline}
.sub{color:var(--soft);margin:.2rem 0 1rem}
.headline{font-size:1.15rem;font-weight:600;padding:.8rem 1rem;border-left:5px solid var(--good);
background:var(--panel);
max-width:none;margin:1rem 0}
.headline.fault{border-color:var(--fault);background:var(--fault-panel)}
.headline.remark{border-color:var(--remark);background:var(--remark-panel)}
nav{font-size:.9rem;display:flex;flex-wrap:wrap;gap:.2rem 1rem;margin:1rem 0}
ul.verdicts{list-style:none;padding:0;margin:.5rem 0}
ul.verdicts li{display:flex;gap:.7rem;padding:.28rem 0;border-bottom:1px solid var(--line)}
ul.verdicts li:last-child{border-bottom:0}
.badge{flex:none;display:inline-block;min-width:5.4rem;text-align:center;font-size:.78rem;font-weight:600;
line-height:1.5rem;height:1.5rem;border:1px solid currentColor;border-radius:.8rem;padding:0 .5rem;color:var(--good)}
.badge.fault{color:var(--fault)}
.badge.remark{color:var(--remark)}
td .badge{min-width:0}
dl{display:grid;grid-template-columns:minmax(7rem,max-content) 1fr;gap:.15rem 1.2rem;margin:.4rem 0}
dt{color:var(--soft)}
dd{margin:0;min-width:0;overflow-wrap:anywhere}
.wide{overflow-x:auto;margin:.6rem 0}
table{border-collapse:collapse;font-size:.86rem;line-height:1.4;min-width:min(100%,40rem)}
th,td{text-align:left;vertical-align:top;padding:.3rem .65rem;border-bottom:1px solid var(--line)}
th{font-weight:600;color:var(--soft);white-space:nowrap;background:var(--panel)}
td{max-width:24rem;overflow-wrap:break-word}
td:last-child{max-width:44rem}
.n{text-align:right;font-variant-numeric:tabular-nums;white-space:nowrap}
tr.fault td{background:var(--fault-panel)}
tr.remark td{background:var(--remark-panel)}
tr.gap td{color:var(--soft)}
code,pre{font:.92em/1.45 ui-monospace,"DejaVu Sans Mono",Menlo,Consolas,monospace}
td code{white-space:nowrap}
td code.long{white-space:normal}
pre{overflow-x:auto;background:var(--panel);padding:.8rem 1rem;border-radius:4px;font-size:.8rem}
details{margin:.35rem 0;border:1px solid var(--line);border-radius:5px;padding:.35rem .8rem}
details[open]{padding-bottom:.8rem}
summary{cursor:pointer;font-weight:600}
summary small,small{font-weight:400;color:var(--soft)}
.soft{color:var(--soft)}
.good{color:var(--good)}.remark-text{color:var(--remark)}.fault-text{color:var(--fault)}
svg{display:block;max-width:none;height:auto}
svg.topology text{font:12px system-ui,"Noto Sans","DejaVu Sans",sans-serif;fill:var(--ink)}
svg.topology .small,svg.topology .port{font-size:10.5px;fill:var(--soft)}
svg.topology .right{text-anchor:end}
svg.topology .name{font-weight:700}
svg.topology .box{fill:var(--panel);stroke:var(--soft);stroke-width:1}
svg.topology .faulty{stroke:var(--fault);stroke-width:2.5}
svg.topology .master .box{fill:var(--paper);stroke:var(--ink);stroke-width:2}
svg.topology a:hover .box{stroke:var(--link);stroke-width:2}
svg.topology .cable path{fill:none;stroke:var(--good);stroke-width:2}
svg.topology .cable path.ebus{stroke-width:5}
svg.topology .doubtful path{stroke:var(--remark);stroke-dasharray:7 3}
svg.topology .bad path{stroke:var(--fault);stroke-width:3;stroke-dasharray:3 3}
svg.topology .count{font-weight:700;text-anchor:middle;font-size:11px}
svg.topology .doubtful .count{fill:var(--remark)}
svg.topology .bad .count{fill:var(--fault)}
.legend{font-size:.82rem;color:var(--soft)}
svg.plot{width:100%;max-width:52rem}
svg.plot text{font:11px system-ui,"DejaVu Sans",sans-serif;fill:var(--soft)}
svg.plot .curve{fill:none;stroke:var(--bar);stroke-width:1.2}
svg.plot .axis{stroke:var(--line);fill:none}
svg.cycle-figures{--cycle-ink:var(--ink);--cycle-bar:var(--bar);--cycle-grid:var(--line);width:100%;max-width:52rem}
footer{margin-top:3rem;color:var(--soft);font-size:.85rem}
@media (max-width:40rem){body{padding:1rem .8rem 3rem}h1{font-size:1.3rem}dl{grid-template-columns:1fr;gap:0 0}
dd{margin-bottom:.4rem}ul.verdicts li{flex-direction:column;gap:.1rem}.badge{align-self:flex-start}}
@media print{body{max-width:none;padding:0;font-size:10pt}nav,.screen,.verdicts a{display:none}
summary{list-style:none}.wide{overflow:visible}table{font-size:8pt;
width:100%;min-width:0}td code{white-space:normal}th,td{padding:.15rem .35rem}thead{display:table-header-group}
tr,ul.verdicts li{break-inside:avoid}h2,h3,summary{break-after:avoid}a{color:inherit}
pre{white-space:pre-wrap;font-size:7pt}
details{border:0;padding:0}details::details-content{content-visibility:visible;block-size:auto}
svg.topology{max-width:100%}th,tr td,.headline,.badge{print-color-adjust:exact;-webkit-print-color-adjust:exact}}
)";

}  // namespace margay::segment_report
