"""How pages look, on a screen from 320 to 1440 pixels and more, and on paper of the size A4."""

SCREEN = """
*{box-sizing:border-box}
body{font:15px/1.5 system-ui,sans-serif;max-width:88rem;margin:2rem auto;padding:0 1.2rem;color:#222}
h1{font-weight:600;font-size:1.9rem;line-height:1.25;margin:.4rem 0 1rem;overflow-wrap:anywhere}
h2{font-weight:600;font-size:1.3rem;margin:2.4rem 0 .8rem;padding-top:.6rem;border-top:1px solid #ddd}
p,li{max-width:70rem;overflow-wrap:anywhere}
.table{overflow-x:auto} table{border-collapse:collapse;margin:1rem 0}
td,th{padding:.2rem .8rem;border-bottom:1px solid #ddd;text-align:left;vertical-align:top}
td.n{text-align:right;white-space:nowrap;font-variant-numeric:tabular-nums}
.bad{color:#b00020;font-weight:600} .good{color:#1b7f3b} .open{color:#8a5a00;font-weight:600}
.banner{padding:.8rem 1rem;border-left:.4rem solid;font-weight:600;background:#f6f6f6;max-width:none}
.first{display:grid;grid-template-columns:minmax(0,1fr) 20rem;gap:1.5rem;align-items:start;margin:1.5rem 0}
.first img{display:block;width:100%;border-radius:.4rem}
.key{display:grid;grid-template-columns:1fr;margin:0}
.key div{padding:.55rem 0;border-bottom:1px solid #ddd} .key div:first-child{padding-top:0}
.key dt{font-size:.9em;color:#555} .key dd{margin:0}
.key dd:first-of-type{font-size:1.6rem;line-height:1.25;font-variant-numeric:tabular-nums}
.key dd+dd{font-size:.85em;line-height:1.35;color:#555}
.still{position:relative;margin:1rem 0}
.still img{display:block;width:100%;height:min(36rem,75vh);object-fit:contain;border:1px solid #ddd}
.view{display:block;width:100%;height:min(36rem,75vh);border:1px solid #ddd}
.still .view{position:absolute;top:0}
.figures,.levels{display:grid;grid-template-columns:repeat(auto-fill,minmax(min(26rem,100%),1fr));gap:1.5rem}
figure{margin:0} img{max-width:100%;height:auto}
figcaption{font-size:.9em;color:#555;margin-top:.3rem} pre{background:#f6f6f6;padding:1rem;overflow:auto}
@media(max-width:64rem){.first{grid-template-columns:minmax(0,1fr)}
.key{grid-template-columns:repeat(auto-fit,minmax(13rem,1fr));gap:0 1.5rem}
.key div:first-child{padding-top:.55rem}}
@media(max-width:40rem){td,th{padding:.2rem .4rem} body{margin:1rem auto}}
"""
# three pages: what happened and how it looks, its pictures, its numbers; what turns or scrolls is left out
PAPER = """
@page{size:A4;margin:11mm}
@media print{
body{font-size:8.5pt;line-height:1.35;margin:0;padding:0;max-width:none;print-color-adjust:exact}
h1{font-size:15pt;margin:0 0 2mm} h2{font-size:10.5pt;margin:3mm 0 1.5mm;padding-top:1mm;break-after:avoid}
p,li{max-width:none;margin:1mm 0} ul{margin:1mm 0;padding-left:5mm} .banner{padding:1.5mm 2mm}
.view,.of-levels,.files,.problem,details{display:none}
.first{display:block;margin:2mm 0} .first img{width:150mm;max-width:100%;margin:0 auto}
.key{grid-template-columns:repeat(3,1fr);gap:0 5mm;margin-top:2mm}
.key div,.key div:first-child{padding:1mm 0;break-inside:avoid} .key dd:first-of-type{font-size:12pt}
.still img{height:52mm;border:0} .still figcaption{text-align:center}
.figures{grid-template-columns:repeat(4,minmax(0,1fr));gap:2.5mm}
figure{break-inside:avoid} figcaption{font-size:6pt;line-height:1.25}
.numbers{columns:2;column-gap:5mm;margin-top:3mm} .numbers h2{margin-top:0}
.table{overflow:visible} table{font-size:5.6pt;line-height:1.15;margin:0 0 2mm;width:100%}
td,th{padding:.2mm .7mm} .numbers td:first-child{overflow-wrap:anywhere} tr{break-inside:avoid}
.numbers tr:first-child{break-after:avoid}
.numbers p{font-size:6pt}
a{color:inherit;text-decoration:none}
}
"""
STYLE = SCREEN + PAPER
